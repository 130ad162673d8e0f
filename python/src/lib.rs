//! The Python module `finalgather._finalgather`, over the library's jobs. `finalgather/_finalgather.pyi` has its types and the units of its arrays.
//!
//! | file | role |
//! |---|---|
//! | `scene.rs` | scenes from files and arrays |
//! | `job.rs`, `request.rs`, `watch.rs`, `turn.rs` | render, bake and prt: what is asked, and how they run beside Python |
//! | `film.rs`, `baked.rs` | their results |
//! | `relight.rs`, `compare.rs` | light from transfer; differences of pictures |
//! | `arrays.rs`, `errors.rs` | numpy arrays and exceptions |

use pyo3::prelude::*;

mod arrays;
mod baked;
mod compare;
mod errors;
mod film;
mod job;
mod relight;
mod request;
mod scene;
mod turn;
mod watch;

/// The compiled part of finalgather.
#[pymodule]
mod _finalgather {
    #[pymodule_export]
    use crate::baked::Baked;
    #[pymodule_export]
    use crate::compare::{Comparison, compare};
    #[pymodule_export]
    use crate::film::Film;
    #[pymodule_export]
    use crate::job::{bake, prt, render};
    #[pymodule_export]
    use crate::relight::{relight, relight_picture};
    #[pymodule_export]
    use crate::scene::Scene;
    #[pymodule_export]
    use crate::turn::_end;
    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.py().import("atexit")?.call_method1("register", (module.getattr("_end")?,))?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
