//! Errors of scene files, with the place in the text and the name that was meant.

use std::ops::Range;
use std::path::Path;

use crate::error::Error;
use crate::nearest::nearest;

/// The text of a scene file, to say where something stands.
#[derive(Clone, Copy)]
pub struct SceneText<'a> {
    pub path: &'a Path,
    pub text: &'a str,
}

impl<'a> SceneText<'a> {
    /// The line of a place, from 1.
    pub fn line(self, span: &Range<usize>) -> usize {
        self.before(span).matches('\n').count() + 1
    }

    /// An error at a place, which is shown.
    pub fn error(self, span: &Range<usize>, problem: &str, cure: &str) -> Error {
        Error::input(self.path, Some(self.line(span)), format!("{problem}\n{}", self.excerpt(span)), cure)
    }

    /// What the reader of TOML, or the format's tables, refuse.
    pub fn refused(self, fault: &toml::de::Error) -> Error {
        let (problem, cure) = explanation(fault.message().trim_end());
        match fault.span() {
            // What is missing has no place.
            Some(span) if span.start < self.text.len() && !fault.message().starts_with("missing") => {
                self.error(&span, &problem, &cure)
            }
            span => Error::input(self.path, span.map(|span| self.line(&span)), problem, cure),
        }
    }

    fn before(self, span: &Range<usize>) -> &'a str {
        &self.text[..self.text.floor_char_boundary(span.start)]
    }

    /// The line of a place, with carets below it.
    fn excerpt(self, span: &Range<usize>) -> String {
        /// A longer line is cut.
        const MOST: usize = 100;
        let before = self.before(span);
        let start = before.rfind('\n').map_or(0, |end| end + 1);
        let line = self.text[start..].lines().next().unwrap_or_default();
        let column = before[start..].chars().count();
        let marked = self.text.get(before.len()..span.end.max(span.start)).and_then(|marked| marked.lines().next());
        let length = marked.map_or(1, |marked| marked.chars().count()).max(1);
        let from = column.saturating_sub(MOST / 2);
        let shown: String = line.chars().skip(from).take(MOST).map(|c| if c.is_control() { ' ' } else { c }).collect();
        let number = self.line(span).to_string();
        let (margin, indent) = (" ".repeat(number.len()), " ".repeat(column - from));
        let carets = "^".repeat(length.min(MOST.saturating_sub(column - from)).max(1));
        format!("  {number} | {}\n  {margin} | {indent}{carets}", shown.trim_end())
    }
}

/// A message of serde or toml, and what helps.
fn explanation(message: &str) -> (String, String) {
    const TABLES: &str = "a scene file has mesh, [camera], [environment], [sun], [sky], [[lights]], [settings] and [materials.NAME]; \
         docs/scene-format.md has every key";
    let mut names = message.split('`').skip(1).step_by(2);
    let mut wrong_name = |kind: &str| {
        let wrong = names.next().unwrap_or_default();
        let known: Vec<_> = names.by_ref().filter(|name| *name != "shadow_size").collect();
        if known.contains(&wrong.replace('-', "_").as_str()) {
            return (format!("{wrong:?} stands here twice, with - and with _"), "leave one of the two out".to_owned());
        }
        let list = || if known.is_empty() { TABLES.to_owned() } else { format!("give one of {}", known.join(", ")) };
        let cure = nearest(wrong, &known).map_or_else(list, |meant| format!("write {meant} in its place"));
        (format!("there is no {kind} {wrong:?}"), cure)
    };
    // Serde's. The reader of TOML has "invalid" texts of its own.
    let invalid = message.strip_prefix("invalid ").and_then(|rest| {
        let of_length = || rest.starts_with("length ").then_some(rest);
        rest.strip_prefix("type: ").or_else(|| rest.strip_prefix("value: ")).or_else(of_length)
    });
    if message.starts_with("unknown field") {
        wrong_name("key")
    } else if message.starts_with("unknown variant") {
        wrong_name("value")
    } else if let Some((found, wanted)) = invalid.and_then(|rest| rest.split_once(", expected ")) {
        let wanted = match wanted {
            "u32" | "u64" => "a whole number, such as 1000 or 1e3",
            "f32" | "f64" => "a number, such as 0.5",
            "a boolean" => "true or false",
            "a map" => "a table, such as [materials.NAME]",
            "an array of length 2" => "two numbers, such as [640, 480]",
            "an array of length 3" => "three numbers, such as [0.5, 0.5, 0.5]",
            other => other,
        };
        (format!("a value of the wrong kind: {found}"), format!("give {wanted} here"))
    } else if message.starts_with("string values must be quoted") {
        (message.to_owned(), "put a text into quotes, and commas between the values of a list".to_owned())
    } else if message.starts_with("missing field `mesh`") {
        ("it names no model".to_owned(), "begin it with mesh = \"MODEL\", a file in its folder".to_owned())
    } else if let Some(name) = message.strip_prefix("missing field ") {
        (format!("{} is missing", name.replace('`', "")), "give it, as docs/scene-format.md shows".to_owned())
    } else if message.starts_with("duplicate") {
        (message.to_owned(), "leave one of the two out".to_owned())
    } else {
        (message.to_owned(), TABLES.to_owned())
    }
}
