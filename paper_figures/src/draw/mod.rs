//! How figures and the page are drawn: plots, HTML, and numbers in words.

pub mod html;
pub mod numbers;
pub mod plot;
