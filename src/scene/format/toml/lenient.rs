//! Accepts in a scene file what options accept: keys with hyphens, whole numbers such as `1e5`, one number for a size or a colour.

use std::collections::{HashMap, HashSet};
use std::ops::Range;

use toml::de::{DeTable, DeValue};

use crate::settings::Settings;

const SETTINGS: &str = "settings";
/// The table whose keys are names that the user gives.
const NAMED: &str = "materials";
/// Keys of colours.
const COLORS: [&str; 7] = ["radiance", "albedo", "emission", "filter", "specular", "intensity", "illuminance"];

/// The texts of the values that [`settle`] puts in place of others, in its order.
pub fn replacements(table: &DeTable) -> Vec<String> {
    fn collect(table: &DeTable, name: &str, texts: &mut Vec<String>) {
        for (key, value) in table {
            match value.get_ref() {
                DeValue::Table(inner) => collect(inner, &below(name, key.get_ref()), texts),
                DeValue::Array(list) if list.iter().any(|item| item.get_ref().is_table()) => {
                    let tables = list.iter().filter_map(|item| item.get_ref().as_table());
                    tables.for_each(|inner| collect(inner, &below(name, key.get_ref()), texts));
                }
                scalar => texts.extend(replacement(name, key.get_ref(), scalar)),
            }
        }
    }
    let mut texts = Vec::new();
    collect(table, "", &mut texts);
    texts
}

/// Renames keys and replaces values, by the [`replacements`] of the same table. Returns where each key of `[settings]` stands, by its current name.
pub fn settle<'a>(table: &mut DeTable<'a>, replacements: &'a [String]) -> HashMap<String, Range<usize>> {
    settle_table(table, "", &mut replacements.iter());
    let settings = table.iter().find(|(key, _)| key.get_ref() == SETTINGS).and_then(|(_, value)| value.get_ref().as_table());
    settings.into_iter().flatten().map(|(key, _)| (Settings::key_of(key.get_ref()).to_owned(), key.span())).collect()
}

/// A list with more numbers than its key takes: its place, and how many the key takes. Serde would leave the rest out.
pub fn too_long(table: &DeTable) -> Option<(Range<usize>, usize)> {
    table.iter().find_map(|(key, value)| {
        let most = match plain(key.get_ref()).as_str() {
            "size" => 2,
            "eye" | "target" | "up" | "background" | "position" | "direction" => 3,
            key if COLORS.contains(&key) => 3,
            _ => usize::MAX,
        };
        match value.get_ref() {
            DeValue::Table(inner) => too_long(inner),
            DeValue::Array(list) if list.iter().any(|item| item.get_ref().is_table()) => {
                list.iter().filter_map(|item| item.get_ref().as_table()).find_map(too_long)
            }
            DeValue::Array(list) if list.len() > most => Some((value.span(), most)),
            _ => None,
        }
    })
}

fn settle_table<'a>(table: &mut DeTable<'a>, name: &str, replacements: &mut std::slice::Iter<'a, String>) {
    let entries = std::mem::take(table);
    let known: HashSet<_> = entries.iter().map(|(key, _)| key.get_ref().to_string()).collect();
    for (mut key, mut value) in entries {
        match value.get_mut() {
            DeValue::Table(inner) => settle_table(inner, &below(name, key.get_ref()), replacements),
            DeValue::Array(list) if list.iter().any(|item| item.get_ref().is_table()) => {
                for item in list.iter_mut() {
                    if let DeValue::Table(inner) = item.get_mut() {
                        settle_table(inner, &below(name, key.get_ref()), replacements);
                    }
                }
            }
            scalar => {
                let text = replacement(name, key.get_ref(), scalar).and_then(|_| replacements.next());
                // Its place stays that of the text in the file.
                if let Some(Ok(better)) = text.map(|text| DeValue::parse(text)) {
                    *scalar = better.into_inner();
                }
            }
        }
        let plain = plain(key.get_ref());
        // A key that stands there in both ways is refused by its name.
        if name != NAMED && !known.contains(&plain) {
            *key.get_mut() = plain.into();
        }
        table.insert(key, value);
    }
}

/// The name of a table in the table `name`.
fn below(name: &str, key: &str) -> String {
    if name.is_empty() { key.to_owned() } else { format!("{name}.{key}") }
}

fn plain(key: &str) -> String {
    key.replace('-', "_")
}

/// The text of a better value for a key of the table `name`.
fn replacement(name: &str, key: &str, value: &DeValue) -> Option<String> {
    match plain(key).as_str() {
        "size" if name == SETTINGS => size(value),
        "ground" if name == SETTINGS => match value.as_str() {
            Some("on") => Some("true".to_owned()),
            Some("off") => Some("false".to_owned()),
            _ => None,
        },
        _ if name == SETTINGS => number(value),
        key if COLORS.contains(&key) => color(value),
        _ => None,
    }
}

/// The text of a number, if the value is one or a text with one.
fn written(value: &DeValue) -> Option<String> {
    let text = match value {
        DeValue::Integer(number) if number.radix() == 10 => number.as_str().to_owned(),
        DeValue::Float(number) => number.as_str().to_owned(),
        DeValue::String(text) => text.trim().replace('_', ""),
        _ => return None,
    };
    text.parse::<f64>().is_ok_and(f64::is_finite).then_some(text)
}

/// A whole number without a point or an exponent. `None` if there is nothing to change.
fn number(value: &DeValue) -> Option<String> {
    /// 2^53. Larger floats may differ from the number in the text.
    const INEXACT: f64 = 9_007_199_254_740_992.0;
    let text = written(value)?;
    let float = text.parse::<f64>().ok()?;
    match value {
        DeValue::Integer(_) => None,
        _ if float.fract() == 0.0 && float.abs() < INEXACT && !(float == 0.0 && float.is_sign_negative()) => {
            Some((float as i64).to_string())
        }
        DeValue::String(_) => Some(text),
        _ => None,
    }
}

/// `[width, height]` of `N` or `"WxH"`.
fn size(value: &DeValue) -> Option<String> {
    let side = |side: &str| side.trim().parse::<u32>().ok();
    let text = number(value).or_else(|| written(value)).or_else(|| value.as_str().map(str::to_owned))?;
    let (width, height) = text.split_once(['x', 'X', '×']).unwrap_or((&text, &text));
    Some(format!("[{}, {}]", side(width)?, side(height)?))
}

/// The same number for red, green and blue.
fn color(value: &DeValue) -> Option<String> {
    written(value).filter(|_| value.as_str().is_none()).map(|number| format!("[{number}, {number}, {number}]"))
}
