//! Final gathering by rasterised ray bundles, on OpenGL 3.3, headless.
//!
//! A noise-free global illumination picture needs thousands of rays at every visible point. Hachisuka's poster "Final Gathering on
//! GPU" (2004) casts them by rasterisation. A bundle of rays that share a direction is one parallel projection of the scene. Depth
//! peeling splits it into layers, from far to near. Each point samples the nearest layer beyond it; KILL (`discard`) culls the
//! layers behind the point. A grid photon map gives the light on the surfaces that the rays hit.
//!
//! ```no_run
//! use finalgather::{Backend, DeviceChoice, Gpu, Loaded, Render, World, WriteOptions};
//!
//! # fn main() -> finalgather::Result<()> {
//! let Loaded { world, settings, .. } = World::load("scenes/cornell.toml".as_ref())?;
//! let gpu = Gpu::headless(Backend::Auto, DeviceChoice::Auto)?;
//! let mut render = Render::new(&gpu, &world, &settings)?;
//! while !render.is_done() {
//!     render.step()?;
//! }
//! render.picture().write("cornell.exr".as_ref(), &WriteOptions::default())?;
//! # Ok(())
//! # }
//! ```
//!
//! # The estimator
//!
//! A *gather point* is a position x with a unit normal n. All points share N directions d, uniform on the sphere. With the weight
//! w = max(n·d, 0), the indirect irradiance at the point is
//!
//! E(x) = π Σ L(x, d) w / Σ w   [W/m²]
//!
//! where L(x, d) is the radiance that the first surface along d sends back: (albedo/π) E_photons, from the photon map, without the
//! surface's own emission. Direct light comes from samples on the lights, each with an exact shadow ray. The radiance of a diffuse point is
//! L = L_emitted + (albedo/π) (E_direct + E). The gather has no factor 1/r², so it makes no bright specks near edges.
//!
//! # Stages
//!
//! Data flows one way: files → [`scene`] → [`photon`] → [`points`] → direct light → [`gather`] → film → [`image`]. [`render`] runs
//! these stages; [`job`] also reads and writes the files. All stages after loading work in *unit space* ([`scene::UnitSpace`]): the
//! scene's bounding box is centred on the origin and has its corners on the unit sphere. Only [`gpu`] calls OpenGL.

pub mod bake;
pub mod bench;
pub mod blocks;
pub mod direct;
pub mod direction;
pub mod error;
pub mod export;
pub mod file;
mod film;
pub mod gather;
pub mod geometry;
pub mod gpu;
pub mod harmonics;
pub mod image;
pub mod job;
pub mod math;
mod memory;
pub mod nearest;
pub mod npy;
pub mod photon;
pub mod photon_map;
mod ply;
pub mod points;
pub mod prepared;
pub mod quantity;
pub mod random;
pub mod reference;
pub mod relight;
pub mod render;
pub mod scene;
pub mod settings;
pub mod shaders;

pub use direction::{Direction, Directions};
pub use error::{Error, Result};
pub use gpu::{Backend, DeviceChoice, Gpu};
pub use image::{Image, WriteOptions};
pub use render::Render;
pub use scene::{Environment, Loaded, Scene, World};
pub use settings::{Estimator, Pipeline, PointSource, Sequence, Settings};
