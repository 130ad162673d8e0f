//! How figures and the page are drawn: plots, HTML, and numbers in words.

mod html;
mod numbers;
pub mod plot;

pub use html::{escaped, note, panel, plot_in_page, table};
pub use numbers::{count, joined, percent, seconds, several, short_percent};
pub use plot::{Axis, Bar, Curve, Panel, Unit};
