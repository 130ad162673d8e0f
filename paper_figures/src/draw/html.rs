//! Parts of the page.

use std::fmt::Display;

/// A table; cells are HTML. The first column names the rows.
pub fn table(head: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let cell = |tag: &str, text: &dyn Display| format!("<{tag}>{text}</{tag}>");
    let head: String = head.iter().map(|name| cell("th", name)).collect();
    let row = |cells: Vec<String>| {
        let cells: String = cells.iter().enumerate().map(|(i, text)| cell(if i == 0 { "th" } else { "td" }, text)).collect();
        format!("<tr>{cells}</tr>\n")
    };
    let body: String = rows.into_iter().map(row).collect();
    format!("<div class=\"wide\"><table>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}</tbody>\n</table></div>\n")
}

/// A picture with a line below.
pub fn panel(file: &str, label: &str) -> String {
    format!("<figure><img src=\"{file}\" alt=\"{label}\"><figcaption>{label}</figcaption></figure>\n")
}

/// An SVG document in the page.
pub fn plot_in_page(svg: &str) -> String {
    format!("<div class=\"plot\">\n{svg}</div>\n")
}

/// A remark on a figure or on the page.
pub fn note(text: &str) -> String {
    format!("<p class=\"note\">{text}</p>\n")
}

/// Plain text as HTML.
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
