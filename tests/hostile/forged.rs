//! The seeds of the fuzz targets, and small files whose headers claim a large size.

use std::fs;
use std::path::Path;

pub fn seed(name: &str) -> Vec<u8> {
    fs::read(Path::new("fuzz/seeds").join(name)).unwrap()
}

/// A small file that says that it is large.
pub fn bmp(width: u32, height: u32) -> Vec<u8> {
    let words = [54_u32, 0, 54, 40, width, height, 1 | 32 << 16, 0, 0, 0, 0, 0, 0];
    [b"BM".to_vec(), words.iter().flat_map(|word| word.to_le_bytes()).collect()].concat()
}

/// With another width and height in its header, whose checksum is not looked at before there is a decoder.
pub fn png(width: u32, height: u32) -> Vec<u8> {
    let mut bytes = seed("texture/rgb.png");
    bytes[16..20].copy_from_slice(&width.to_be_bytes());
    bytes[20..24].copy_from_slice(&height.to_be_bytes());
    let checksum = crc32(&bytes[12..29]);
    bytes[29..33].copy_from_slice(&checksum.to_be_bytes());
    bytes
}

fn crc32(bytes: &[u8]) -> u32 {
    let step = |crc: u32| if crc & 1 == 1 { 0xedb8_8320 ^ (crc >> 1) } else { crc >> 1 };
    !bytes.iter().fold(!0, |crc, &byte| (0..8).fold(crc ^ u32::from(byte), |crc, _| step(crc)))
}

/// `file` with its data window, from (0, 0), made to end elsewhere.
pub fn exr(file: &str, [right, bottom]: [i32; 2], end: [i32; 2]) -> Vec<u8> {
    let words = |[x, y]: [i32; 2]| -> Vec<u8> { [0, 0, x, y].iter().flat_map(|word: &i32| word.to_le_bytes()).collect() };
    let mut bytes = seed(file);
    let windows: Vec<usize> = (0..bytes.len() - 16).filter(|&at| bytes[at..at + 16] == words([right, bottom])[..]).collect();
    assert!(!windows.is_empty(), "{file} has no such window");
    for at in windows {
        bytes[at..at + 16].copy_from_slice(&words(end));
    }
    bytes
}

pub fn npy(shape: &str, data: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({shape}), }}\n");
    [b"\x93NUMPY\x01\0", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}
