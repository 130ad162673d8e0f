//! OpenGL 3.3 core without a window. Only this folder names `glow` or uses `unsafe`. It knows neither scenes nor photons.
//!
//! [`Gpu::headless`] makes a context. [`Texture`], [`Target`], [`Program`], [`VertexArray`] and [`SampleQuery`] own a GL object and delete it
//! when dropped. A [`Draw`] holds all GL state that it needs, so no state carries over to the next draw. Long draws are split, because a
//! watchdog resets a device that is busy for seconds. [`Gpu::check`] reports GL errors and lost contexts. [`StageClock`] measures device time.

mod clock;
mod context;
mod draw;
mod headless;
mod osmesa;
mod pace;
mod program;
mod query;
mod reset;
mod resource;
mod target;
mod texture;
mod vertices;
#[cfg(feature = "window")]
mod window;

pub use clock::{StageClock, StageTimes};
pub use context::{Gpu, GpuInfo, Limits};
pub use draw::{Blend, DepthTest, Draw, Shape};
pub use headless::{Backend, DeviceChoice, DeviceInfo, list_devices};
pub use program::{Program, ShaderSource, Uniform, replace_shader_text};
pub use query::SampleQuery;
pub use target::Target;
pub use texture::{Filter, Format, Texture, Wrap};
pub use vertices::VertexArray;
#[cfg(feature = "window")]
pub use window::Screen;
