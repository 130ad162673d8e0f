//! Text of OBJ and MTL files: encodings, line ends and words. [`Decoder::decode`] and [`Lines`] are the entry points.

use std::borrow::Cow;
use std::collections::HashSet;
use std::path::Path;

use crate::error::{Error, Result};
use crate::scene::format::warnings::{Fault, Place, Warnings};

/// Decodes the files of one model. It tells of each oddity once, because a library has those of its model.
#[derive(Default)]
pub struct Decoder {
    told: HashSet<&'static str>,
}

impl Decoder {
    /// The text of a file in UTF-8, UTF-16 or Windows-1252.
    ///
    /// # Errors
    /// [`Error::Input`] for a binary file.
    pub fn decode<'a>(&mut self, warnings: &mut Warnings, path: &Path, bytes: &'a [u8]) -> Result<Cow<'a, str>> {
        if let Some(text) = utf_16(bytes) {
            let problem = || "this file is UTF-16, not UTF-8".to_owned();
            self.mend(
                warnings,
                path,
                1,
                &Fault { kind: "UTF-16", problem: &problem, mend: "it is decoded", cure: "save it as UTF-8" },
            )?;
            return Ok(text.into());
        }
        let bytes = without_filling(bytes);
        if bytes.contains(&0) {
            return Err(Error::input(path, None, "this is a binary file, not a Wavefront OBJ or MTL", "export the model as OBJ"));
        }
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => Cow::from(text),
            Err(_) => {
                let mut text = String::with_capacity(bytes.len() + bytes.len() / 16);
                for (line, part) in (1..).zip(bytes.split_inclusive(|&byte| byte == b'\n')) {
                    match std::str::from_utf8(part) {
                        Ok(part) => text += part,
                        Err(_) => {
                            text.extend(part.iter().copied().map(windows_1252));
                            self.tell_of_names(warnings, path, line, part);
                        }
                    }
                }
                text.into()
            }
        };
        Ok(match text {
            Cow::Borrowed(text) => text.trim_start_matches('\u{feff}').into(),
            Cow::Owned(text) => text.trim_start_matches('\u{feff}').to_owned().into(),
        })
    }

    /// Comments and other statements than these have no names that matter.
    fn tell_of_names(&mut self, warnings: &mut Warnings, path: &Path, line: usize, statement: &[u8]) {
        let keyword: Vec<u8> = statement.trim_ascii().iter().map(u8::to_ascii_lowercase).take(6).collect();
        if ["usemtl", "mtllib", "newmtl", "map_kd"].iter().any(|known| keyword == known.as_bytes())
            && self.told.insert("Windows-1252")
        {
            let text = || "this name is not UTF-8; it is read as Windows-1252 (Latin-1)".to_owned();
            warnings.tell(Place { path, line: Some(line) }, "Windows-1252", &text);
        }
    }

    /// Tells of line ends that only old systems know.
    pub fn check_ends(&mut self, warnings: &mut Warnings, path: &Path, lines: &Lines) -> Result<()> {
        let Some(line) = lines.lone_return else { return Ok(()) };
        let problem = || "a line ends in a carriage return alone".to_owned();
        let cure = "save it with line ends of this system";
        self.mend(
            warnings,
            path,
            line,
            &Fault { kind: "carriage return", problem: &problem, mend: "it is taken for a line end", cure },
        )
    }

    fn mend(&mut self, warnings: &mut Warnings, path: &Path, line: usize, fault: &Fault) -> Result<()> {
        match self.told.insert(fault.kind) {
            true => warnings.mend(Place { path, line: Some(line) }, fault),
            false => Ok(()),
        }
    }
}

/// Without zeros at the end, with which some systems fill blocks.
fn without_filling(bytes: &[u8]) -> &[u8] {
    &bytes[..bytes.iter().rposition(|&byte| byte != 0).map_or(0, |last| last + 1)]
}

/// Text in UTF-16, with a mark or with zeros for all high bytes of its start.
fn utf_16(bytes: &[u8]) -> Option<String> {
    /// Characters at the start to look at.
    const START: usize = 64;
    let pairs = bytes.as_chunks::<2>().0;
    let start = &pairs[..pairs.len().min(START)];
    let ascii = |high: usize| pairs.len() >= 4 && start.iter().all(|pair| pair[high] == 0 && pair[1 - high] != 0);
    let big = match bytes {
        [0xfe, 0xff, ..] => true,
        [0xff, 0xfe, ..] => false,
        _ if ascii(0) => true,
        _ if ascii(1) => false,
        _ => return None,
    };
    let units = pairs.iter().map(|&pair| if big { u16::from_be_bytes(pair) } else { u16::from_le_bytes(pair) });
    let text = char::decode_utf16(units).map(|unit| unit.unwrap_or(char::REPLACEMENT_CHARACTER));
    Some(text.filter(|&character| character != '\u{feff}' && character != '\0').collect())
}

/// A character of Windows-1252, which differs from Latin-1 in 32 places.
fn windows_1252(byte: u8) -> char {
    const HIGH: [char; 32] = [
        '€', '\u{81}', '‚', 'ƒ', '„', '…', '†', '‡', 'ˆ', '‰', 'Š', '‹', 'Œ', '\u{8d}', 'Ž', '\u{8f}', '\u{90}', '‘', '’', '“',
        '”', '•', '–', '—', '˜', '™', 'š', '›', 'œ', '\u{9d}', 'ž', 'Ÿ',
    ];
    match byte {
        0x80..=0x9f => HIGH[usize::from(byte - 0x80)],
        _ => char::from(byte),
    }
}

/// Statements with the numbers of their lines, from 1. A line that ends in `\` goes on in the next. Lines end in CR, LF or both.
pub struct Lines<'a> {
    rest: &'a str,
    line: usize,
    /// The first line that ends in CR alone.
    lone_return: Option<usize>,
}

impl<'a> Lines<'a> {
    pub fn new(text: &'a str) -> Self {
        Self { rest: text, line: 0, lone_return: None }
    }

    fn next_line(&mut self) -> Option<&'a str> {
        if self.rest.is_empty() {
            return None;
        }
        self.line += 1;
        let bytes = self.rest.as_bytes();
        let Some(end) = memchr::memchr2(b'\n', b'\r', bytes) else { return Some(std::mem::take(&mut self.rest)) };
        let line = &self.rest[..end];
        let pair = bytes[end] == b'\r' && bytes.get(end + 1) == Some(&b'\n');
        if bytes[end] == b'\r' && !pair {
            self.lone_return.get_or_insert(self.line);
        }
        self.rest = &self.rest[end + 1 + usize::from(pair)..];
        Some(line)
    }
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, Cow<'a, str>);

    fn next(&mut self) -> Option<Self::Item> {
        let first = self.next_line()?;
        let number = self.line;
        let Some(start) = continued(first) else { return Some((number, first.into())) };
        let mut statement = start.to_owned();
        while let Some(line) = self.next_line() {
            statement.push(' ');
            match continued(line) {
                Some(part) => statement += part,
                None => {
                    statement += line;
                    break;
                }
            }
        }
        Some((number, statement.into()))
    }
}

/// The line without the `\` at its end. A comment does not go on, and a picture's name may end so.
fn continued(line: &str) -> Option<&str> {
    let before = line.trim_ascii_end().strip_suffix('\\')?;
    let start = line.trim_ascii_start();
    let is_picture = start.get(..4).is_some_and(|word| word.eq_ignore_ascii_case("map_"));
    (!start.starts_with('#') && (!is_picture || before.ends_with([' ', '\t']))).then_some(before)
}

/// The first word and the rest of the text, both trimmed.
pub fn split_word(text: &str) -> (&str, &str) {
    let text = text.trim();
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    (word, rest.trim_start())
}

/// Removes a comment. A name may contain `#`, so try it whole first.
pub fn uncomment(text: &str) -> &str {
    text.split_once('#').map_or(text, |(before, _)| before).trim_end()
}

/// Removes quotes around a name.
pub fn unquote(text: &str) -> &str {
    let text = text.trim();
    let inner = |quote| text.strip_prefix(quote).and_then(|rest| rest.strip_suffix(quote));
    inner('"').or_else(|| inner('\'')).unwrap_or(text).trim()
}

/// The names that a statement may mean, the likeliest first: whole, without quotes, without a comment, with plain spaces for `\ `.
pub fn names_of(text: &str) -> impl Iterator<Item = Cow<'_, str>> {
    let plain = unquote(uncomment(text));
    let escaped = plain.contains("\\ ").then(|| plain.replace("\\ ", " "));
    let names = [text, unquote(text), uncomment(text), plain].map(Cow::from).into_iter().chain(escaped.map(Cow::from));
    names.filter(|name| !name.is_empty())
}
