//! Reads PLY files: the header, and the rows of one element after the other.
//!
//! The crate `ply-rs-bw` is not used: in ASCII it refuses `nan` and `.5`, which scanners write.

use std::str::SplitAsciiWhitespace;

/// What is wrong with a file. `line` counts from 1; data in binary have none.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PlyFault {
    pub line: Option<usize>,
    pub problem: String,
}

/// An element of the header, such as `vertex` or `face`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Element {
    pub name: String,
    /// Number of rows that the header claims.
    pub count: usize,
    pub properties: Vec<Property>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Property {
    pub name: String,
    pub kind: Scalar,
    /// Type of the length of a list. `None` for a single number.
    pub length: Option<Scalar>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    Char,
    UChar,
    Short,
    UShort,
    Int,
    UInt,
    Float,
    Double,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

/// The statements of a header.
#[derive(Debug)]
pub struct Header {
    /// In the order of their rows.
    pub elements: Vec<Element>,
    /// Without the word `comment`.
    pub comments: Vec<String>,
    /// Lines that are no statements, with their numbers. Some programs leave out the word `comment`.
    pub unknown: Vec<PlyFault>,
}

/// The rows that were not read yet.
#[derive(Debug)]
pub struct Rows<'a> {
    encoding: Encoding,
    rest: &'a [u8],
    /// Number of the next line in ASCII.
    line: usize,
}

/// One row of an element, with an entry for each property.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ElementRow {
    pub line: Option<usize>,
    /// Single numbers. 0 for a list.
    pub numbers: Vec<f64>,
    /// Lists. Empty for a single number.
    pub lists: Vec<Vec<f64>>,
    /// Whether its line has more numbers than the header says.
    pub is_longer: bool,
}

impl Element {
    pub fn find(&self, name: &str) -> Option<usize> {
        self.properties.iter().position(|property| property.name == name)
    }

    /// The index of a property that is a single number.
    pub fn number(&self, name: &str) -> Option<usize> {
        self.find(name).filter(|&index| self.properties[index].length.is_none())
    }
}

impl Scalar {
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "char" | "int8" => Self::Char,
            "uchar" | "uint8" => Self::UChar,
            "short" | "int16" => Self::Short,
            "ushort" | "uint16" => Self::UShort,
            "int" | "int32" => Self::Int,
            "uint" | "uint32" => Self::UInt,
            "float" | "float32" => Self::Float,
            "double" | "float64" => Self::Double,
            _ => return None,
        })
    }

    fn size(self) -> usize {
        match self {
            Self::Char | Self::UChar => 1,
            Self::Short | Self::UShort => 2,
            Self::Int | Self::UInt | Self::Float => 4,
            Self::Double => 8,
        }
    }
}

/// Elements of a file, and properties of an element. Each new name is compared with all before.
const MOST_NAMES: usize = 1000;

/// Parses the header of a file.
///
/// # Errors
/// When a statement is wrong, or a name is there twice.
pub fn parse(bytes: &[u8]) -> Result<(Header, Rows<'_>), PlyFault> {
    let mut rest = bytes;
    let mut header = Header { elements: Vec::new(), comments: Vec::new(), unknown: Vec::new() };
    let mut encoding = None;
    for line in 1.. {
        let fault = |problem: String| PlyFault { line: Some(line), problem };
        if rest.is_empty() {
            // It may be misspelt.
            let ends = fault("the file ends before end_header".to_owned());
            return Err(header.unknown.into_iter().next().unwrap_or(ends));
        }
        let text = String::from_utf8_lossy(next_line(&mut rest));
        let text = text.trim();
        let words: Vec<&str> = text.split_ascii_whitespace().collect();
        match words[..] {
            ["ply"] if line == 1 => {}
            _ if line == 1 => return Err(fault("it does not begin with \"ply\"".to_owned())),
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(fault(format!("{} is no format", quoted(name)))),
                });
            }
            ["comment" | "obj_info", ..] => {
                header.comments.push(text.split_once(char::is_whitespace).map_or("", |(_, text)| text).trim_start().to_owned());
            }
            ["element", name, count] => {
                let count = count.parse().map_err(|_| fault(format!("{} is no number of rows", quoted(count))))?;
                if header.elements.len() == MOST_NAMES {
                    return Err(fault(format!("the header names more than {MOST_NAMES} elements")));
                }
                if header.elements.iter().any(|element| element.name == name) {
                    return Err(fault("the header names an element or a property twice".to_owned()));
                }
                header.elements.push(Element { name: name.to_owned(), count, properties: Vec::new() });
            }
            ["property", ref kind @ .., name] => {
                let kinds: Option<Vec<Scalar>> =
                    kind.strip_prefix(&["list"]).unwrap_or(kind).iter().map(|name| Scalar::named(name)).collect();
                let (length, kind) = match (kind.len(), kinds.as_deref()) {
                    (1, Some(&[kind])) => (None, kind),
                    (3, Some(&[length, kind])) => (Some(length), kind),
                    _ => return Err(fault(format!("{} is no type of a property", quoted(&kind.join(" "))))),
                };
                let Some(element) = header.elements.last_mut() else {
                    return Err(fault("a property before any element".to_owned()));
                };
                if element.properties.len() == MOST_NAMES {
                    return Err(fault(format!("an element has more than {MOST_NAMES} properties")));
                }
                if element.find(name).is_some() {
                    return Err(fault("the header names an element or a property twice".to_owned()));
                }
                element.properties.push(Property { name: name.to_owned(), kind, length });
            }
            ["end_header"] => {
                let encoding = encoding.ok_or_else(|| fault("the header names no format".to_owned()))?;
                return Ok((header, Rows { encoding, rest, line: line + 1 }));
            }
            [] => {}
            _ => header.unknown.push(fault(format!("{} is no statement of a header", quoted(text)))),
        }
    }
    unreachable!("the loop ends with the file")
}

impl Rows<'_> {
    /// Whether nothing is left.
    pub fn are_done(&self) -> bool {
        self.rest.is_empty()
    }

    /// Checks that the rows of `element` fit into the rest of the file. Memory is safe without, because only real rows take some.
    ///
    /// # Errors
    /// When the header claims too many.
    pub fn holds(&self, element: &Element) -> Result<(), PlyFault> {
        let left = self.rest.len();
        let is_ascii = self.encoding == Encoding::Ascii;
        let least = |property: &Property| match property {
            // A digit and a separator.
            _ if is_ascii => 2,
            // An empty list still has its length.
            Property { kind, length, .. } => length.unwrap_or(*kind).size(),
        };
        let needed = element.count.checked_mul(element.properties.iter().map(least).sum());
        if needed.is_none_or(|needed| needed > left + usize::from(is_ascii)) {
            let problem = format!("the header says {} of {}, but {left} bytes are left for them", element.count, element.name);
            return Err(PlyFault { line: None, problem });
        }
        Ok(())
    }

    /// Reads the next row, which is one of `element`. An element without properties has no rows.
    ///
    /// # Errors
    /// When the file ends, or the row is no row of numbers.
    pub fn read(&mut self, element: &Element, row: &mut ElementRow) -> Result<(), PlyFault> {
        row.numbers.clear();
        row.numbers.resize(element.properties.len(), 0.0);
        row.lists.resize_with(element.properties.len(), Vec::new);
        row.lists.iter_mut().for_each(Vec::clear);
        match self.encoding {
            Encoding::Ascii => self.read_ascii(element, row),
            Encoding::Little => self.read_binary::<false>(element, row),
            Encoding::Big => self.read_binary::<true>(element, row),
        }
        .map_err(|problem| PlyFault { line: row.line, problem: format!("{problem} in {}", element.name) })
    }

    /// Passes over the rows of `element`.
    ///
    /// # Errors
    /// As [`Self::read`].
    pub fn skip(&mut self, element: &Element) -> Result<(), PlyFault> {
        let mut row = ElementRow::default();
        match element.properties.is_empty() {
            true => Ok(()),
            false => (0..element.count).try_for_each(|_| self.read(element, &mut row)),
        }
    }

    fn read_ascii(&mut self, element: &Element, row: &mut ElementRow) -> Result<(), String> {
        row.line = Some(self.line);
        let line = loop {
            if self.rest.is_empty() {
                return Err("the file ends".to_owned());
            }
            let line = next_line(&mut self.rest);
            row.line = Some(self.line);
            self.line += 1;
            if !line.trim_ascii().is_empty() {
                break line;
            }
        };
        let text = str::from_utf8(line).map_err(|_| "a line is no text".to_owned())?;
        let mut words = text.split_ascii_whitespace();
        for (index, property) in element.properties.iter().enumerate() {
            let number = ascii_number(&mut words)?;
            if property.length.is_none() {
                row.numbers[index] = number;
                continue;
            }
            let length = length_of(number, line.len())?;
            for _ in 0..length {
                row.lists[index].push(ascii_number(&mut words)?);
            }
        }
        row.is_longer = words.next().is_some();
        Ok(())
    }

    fn read_binary<const BIG: bool>(&mut self, element: &Element, row: &mut ElementRow) -> Result<(), String> {
        for (index, property) in element.properties.iter().enumerate() {
            let Some(length) = property.length else {
                row.numbers[index] = self.scalar::<BIG>(property.kind)?;
                continue;
            };
            let length = length_of(self.scalar::<BIG>(length)?, self.rest.len() / property.kind.size())?;
            for _ in 0..length {
                row.lists[index].push(self.scalar::<BIG>(property.kind)?);
            }
        }
        Ok(())
    }

    fn scalar<const BIG: bool>(&mut self, kind: Scalar) -> Result<f64, String> {
        macro_rules! number {
            ($type:ty) => {{
                let (&bytes, rest) = self.rest.split_first_chunk().ok_or("the file ends")?;
                self.rest = rest;
                f64::from(if BIG { <$type>::from_be_bytes(bytes) } else { <$type>::from_le_bytes(bytes) })
            }};
        }
        Ok(match kind {
            Scalar::Char => number!(i8),
            Scalar::UChar => number!(u8),
            Scalar::Short => number!(i16),
            Scalar::UShort => number!(u16),
            Scalar::Int => number!(i32),
            Scalar::UInt => number!(u32),
            Scalar::Float => number!(f32),
            Scalar::Double => number!(f64),
        })
    }
}

/// Takes the next line, without its end: a line feed, a carriage return, or both.
fn next_line<'a>(rest: &mut &'a [u8]) -> &'a [u8] {
    let end = rest.iter().position(|byte| b"\r\n".contains(byte)).unwrap_or(rest.len());
    let (line, after) = rest.split_at(end);
    *rest = after.strip_prefix(b"\r\n").or_else(|| after.get(1..)).unwrap_or_default();
    line
}

/// The next number. Not-a-numbers of C libraries, as `-nan(ind)` and `1.#QNAN`, are NaN.
fn ascii_number(words: &mut SplitAsciiWhitespace) -> Result<f64, String> {
    let word = words.next().ok_or("a line has too few numbers")?;
    let is_strange = || word.contains('#') || word.to_ascii_lowercase().contains("nan");
    word.parse().or_else(|_| if is_strange() { Ok(f64::NAN) } else { Err(format!("{} for a number", quoted(word))) })
}

/// The length of a list that can have at most `most` entries.
fn length_of(number: f64, most: usize) -> Result<usize, String> {
    let length = number as usize;
    if length as f64 == number && length <= most {
        Ok(length)
    } else {
        Err(format!("a list of {number} numbers, where {most} may follow,"))
    }
}

/// Text of a file for a message, cut where it is long.
fn quoted(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{:?} and so on", &text[..end]),
        None => format!("{text:?}"),
    }
}
