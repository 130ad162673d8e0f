//! OpenGL 3.3 core, headless: the only folder that names `glow` or needs `unsafe`; it knows neither scenes nor photons.
//!
//! [`Gpu::headless`] makes a context. Objects ([`Texture`], [`Target`], [`Program`], [`VertexArray`], [`SampleQuery`]) own their GL
//! name and delete it when dropped. A draw is one value ([`Draw`]) with
//! all the state that shapes it, so none is left behind for the next, and is cut short where it would keep the device so long that a watchdog
//! resets it. A context that is lost all the same says so at the next [`Gpu::check`]. A [`StageClock`] measures what the device does meanwhile.

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
pub use draw::{Blend, DepthTest, Draw, Geometry};
pub use headless::{Backend, DeviceChoice, DeviceInfo, list_devices};
pub use program::{Program, ShaderSource, Uniform, replace_shader_text};
pub use query::SampleQuery;
pub use target::Target;
pub use texture::{Filter, Format, Texture, Wrap};
pub use vertices::VertexArray;
#[cfg(feature = "window")]
pub use window::Screen;
