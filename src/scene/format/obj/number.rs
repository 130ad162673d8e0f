//! Numbers in OBJ and MTL files, also those that other programs write wrongly.

/// What a word says.
#[derive(Clone, Copy, PartialEq)]
pub enum Word {
    /// A number, which may be infinite or none (NaN).
    Number(f64),
    /// A number that is not written as it should be, such as `1,5`.
    Odd(f64),
    /// No number. Some programs write `-nan(ind)` or `1.#IND`.
    Other,
}

/// Reads a word without comment.
pub fn read(word: &str) -> Word {
    if let Ok(value) = word.parse() {
        return Word::Number(rounded_once(word, value));
    }
    // Commas before the fraction or behind the number, and Fortran's exponents.
    let plain = word.trim_end_matches([',', ';']);
    let written = plain.replacen(',', ".", 1).replacen(['d', 'D'], "e", 1);
    let starts = written.trim_start_matches(['-', '+', '.']).starts_with(|c: char| c.is_ascii_digit());
    match written.parse() {
        Ok(value) if starts => Word::Odd(rounded_once(&written, value)),
        _ => Word::Other,
    }
}

/// A number in f64 whose rounding to f32 is that of the text. Rounding twice differs where the f64 lies midway between two f32.
fn rounded_once(word: &str, exact: f64) -> f64 {
    /// The bits that f32 lacks, and their value midway.
    const LOST: u64 = (1 << 29) - 1;
    const MIDWAY: u64 = 1 << 28;
    if exact == 0.0 || exact.to_bits() & LOST != MIDWAY && exact.abs() >= f64::from(f32::MIN_POSITIVE) {
        return exact;
    }
    let Ok(near) = word.parse::<f32>() else { return exact };
    match f64::from(near) - f64::from(exact as f32) {
        above if above > 0.0 => exact.next_up(),
        below if below < 0.0 => exact.next_down(),
        _ => exact,
    }
}

/// The words of a row of numbers, up to a comment. `1.#IND` is a word, no comment.
pub fn words(text: &str) -> impl Iterator<Item = &str> {
    let mut ended = false;
    text.split_ascii_whitespace().map_while(move |word| {
        if ended {
            return None;
        }
        if !word.as_bytes().contains(&b'#') {
            return Some(word);
        }
        let (before, after) = word.split_once('#').unwrap_or((word, ""));
        if before.ends_with('.') && after.starts_with(|c: char| c.is_ascii_alphabetic()) {
            return Some(word);
        }
        ended = true;
        (!before.is_empty()).then_some(before)
    })
}
