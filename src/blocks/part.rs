//! Sums of some of a job's blocks in a file: a checkpoint, or the result of a shard.
//!
//! The file has the safetensors format, so other programs can read it. Its metadata contain JSON under `finalgather`: the job (`job`: all inputs
//! that determine the result, with scene and renderer), further state of the job (`state`), and the SHA-256 of both and all tensors (`sha256`).
//! Tensors are one-dimensional, hold 32-bit floats, and are named TREE/FIRST+BLOCKS/PLANE.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::io::Write;
use std::ops::Range;
use std::path::Path;

use safetensors::tensor::{Dtype, Metadata, SafeTensors, TensorInfo};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::Blocks;
use super::pairwise::{Node, PairwiseSum, Sum};
use crate::error::{Error, Result};
use crate::file::{self, explained};

/// The format's name and version.
const FORMAT: &str = "part 1";
/// Key of the metadata.
const ABOUT: &str = "finalgather";

/// A sum that consists of planes of floats.
pub trait Planes: Sum {
    fn planes(&self) -> Vec<&[f32]>;
}

/// Planes of floats by their numbers.
type Numbered<'a> = BTreeMap<u32, &'a [f32]>;

/// Sums of some of a job's blocks.
pub struct Part<'a> {
    /// Names and values. Two jobs with equal values sum the same blocks to the same bits.
    pub job: Value,
    pub state: Value,
    tensors: BTreeMap<String, Cow<'a, [f32]>>,
}

impl<'a> Part<'a> {
    pub fn new(job: Value, state: Value) -> Self {
        Self { job, state, tensors: BTreeMap::new() }
    }

    pub fn put(&mut self, name: impl Into<String>, floats: &'a [f32]) {
        self.tensors.insert(name.into(), Cow::Borrowed(floats));
    }

    pub fn get(&self, name: &str) -> Option<&[f32]> {
        self.tensors.get(name).map(Cow::as_ref)
    }

    /// Names of all tensors. Parts of one job with the same names have the same sums.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.tensors.keys().map(String::as_str)
    }

    pub fn put_tree<T: Planes>(&mut self, tree: &str, sum: &'a PairwiseSum<T>) {
        for node in sum.nodes() {
            for (plane, floats) in node.sum.planes().into_iter().enumerate() {
                self.put(format!("{tree}/{}+{}/{plane}", node.first, node.blocks), floats);
            }
        }
    }

    /// The sums of a tree over `blocks` in the file `path`. `sum` makes a node's sum from its blocks and planes; `None` if they do not fit.
    ///
    /// # Errors
    /// [`Error::Input`] if the tensors do not make a tree.
    pub fn tree<T: Sum>(
        &self,
        path: &Path,
        tree: &str,
        blocks: Blocks,
        sum: impl Fn(Range<u32>, Vec<&[f32]>) -> Option<T>,
    ) -> Result<PairwiseSum<T>> {
        let whole = || {
            let mut nodes = PairwiseSum::default();
            for ((first, length), planes) in self.planes_of(tree)? {
                let complete = planes.keys().copied().eq(0..planes.len() as u32);
                let end = first.checked_add(length).filter(|&end| complete && end <= blocks.count())?;
                let sum = sum(first..end, planes.into_values().collect())?;
                nodes.insert(Node { first, blocks: length, sum }).ok()?;
            }
            Some(nodes)
        };
        whole().ok_or_else(|| Error::input(path, None, format!("damaged: its {tree} does not fit together"), "make it again"))
    }

    /// The planes of each node, by its first block and number of blocks. `None` if a name is not that of a node.
    fn planes_of(&self, tree: &str) -> Option<BTreeMap<(u32, u32), Numbered<'_>>> {
        let mut planes: BTreeMap<_, Numbered> = BTreeMap::new();
        for (name, floats) in &self.tensors {
            let Some(name) = name.strip_prefix(tree).and_then(|rest| rest.strip_prefix('/')) else { continue };
            let (range, plane) = name.split_once('/')?;
            let (first, blocks) = range.split_once('+')?;
            planes.entry((first.parse().ok()?, blocks.parse().ok()?)).or_default().insert(plane.parse().ok()?, &**floats);
        }
        Some(planes)
    }

    /// Checks before the work that [`Self::write`] to this path should succeed.
    ///
    /// # Errors
    /// [`Error::Usage`] if it cannot.
    pub fn check_writable(path: &Path) -> Result<()> {
        file::check_writable(path)
    }

    /// # Errors
    /// [`Error::Output`] if it cannot be written. A file that was there stays.
    pub fn write(&self, path: &Path) -> Result<()> {
        let about = json!({ "format": FORMAT, "job": self.job, "state": self.state, "sha256": self.sha256() });
        let about = HashMap::from([(ABOUT.to_owned(), about.to_string())]);
        let mut offset = 0;
        let info = |(name, floats): (&String, &Cow<[f32]>)| {
            let first = offset;
            offset += size_of_val(&**floats);
            (name.clone(), TensorInfo { dtype: Dtype::F32, shape: vec![floats.len()], data_offsets: (first, offset) })
        };
        let header = Metadata::new(Some(about), self.tensors.iter().map(info).collect()).expect("one tensor after the other");
        let mut header = serde_json::to_vec(&header).expect("a header is plain text");
        header.resize(header.len().next_multiple_of(8), b' ');
        // Tensor by tensor, because the whole file in memory would double the sums.
        file::write_by(path, |mut file| {
            file.write_all(&(header.len() as u64).to_le_bytes())?;
            file.write_all(&header)?;
            self.tensors.values().try_for_each(|floats| file.write_all(bytemuck::cast_slice(floats)))
        })
    }

    /// # Errors
    /// [`Error::Input`] if the file cannot be read, is no part, or is damaged.
    pub fn read(path: &Path) -> Result<Part<'static>> {
        let read = || match fs::metadata(path).map_err(|error| explained(path, error))?.is_file() {
            true => fs::read(path),
            false => Err(std::io::Error::other("no regular file")),
        };
        let bytes = read()
            .map_err(|error| Error::input(path, None, format!("cannot read this part: {error}"), "name a part or checkpoint"))?;
        Part::parse(path, &bytes)
    }

    /// As [`Self::read`], from the bytes of the file at `path`.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Part<'static>> {
        let bad = |problem: &str| Error::input(path, None, problem, "name a part or checkpoint that this version has written");
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(|_| bad("no part, or cut short"))?;
        let about = header.metadata().as_ref().and_then(|metadata| serde_json::from_str(metadata.get(ABOUT)?).ok());
        let mut about: Value = about.ok_or_else(|| bad("no part of finalgather"))?;
        if about["format"] != FORMAT {
            return Err(bad("a part in another format"));
        }
        let mut part = Part::new(about["job"].take(), about["state"].take());
        for (name, view) in SafeTensors::deserialize(bytes).map_err(|_| bad("no part, or cut short"))?.iter() {
            if view.dtype() != Dtype::F32 {
                return Err(bad("damaged: a tensor is not of floats"));
            }
            part.tensors.insert(name.to_owned(), Cow::Owned(bytemuck::pod_collect_to_vec(view.data())));
        }
        if about["sha256"] != part.sha256() {
            return Err(bad("damaged: its checksum is not that of its numbers"));
        }
        Ok(part)
    }

    /// Whether this version wrote it.
    ///
    /// # Errors
    /// [`Error::Input`] that names the version that did.
    pub fn check_version(&self, path: &Path) -> Result<()> {
        let ours = env!("CARGO_PKG_VERSION");
        if self.job["version"] == ours {
            return Ok(());
        }
        let problem = format!("of version {}, and this is {ours}", self.job["version"]);
        Err(Error::input(path, None, problem, "merge with the version that made it"))
    }

    /// A value of the job or state of a part that was read from `path`.
    ///
    /// # Errors
    /// [`Error::Input`] when it is none.
    pub fn parse_value<T: DeserializeOwned>(path: &Path, value: &Value) -> Result<T> {
        let damaged = |_| Error::input(path, None, "damaged: it does not say what it is of", "make it again");
        T::deserialize(value).map_err(damaged)
    }

    /// Checks that it is of this job.
    ///
    /// # Errors
    /// [`Error::Input`] that names the differences.
    pub fn check(&self, path: &Path, job: &Value) -> Result<()> {
        let mut differences = Vec::new();
        compare("", &self.job, job, &mut differences);
        if differences.is_empty() {
            return Ok(());
        }
        let problem = format!("of another job: {}", differences.join("; "));
        Err(Error::input(path, None, problem, "give the scene and settings that it was made with, or another file"))
    }

    fn sha256(&self) -> String {
        let mut hasher = Sha256::new();
        hasher.update(format!("{} {}", self.job, self.state));
        for (name, floats) in &self.tensors {
            hasher.update(format!(" {name} {} ", floats.len()));
            hasher.update(bytemuck::cast_slice::<f32, u8>(floats));
        }
        hex(&hasher.finalize())
    }
}

/// SHA-256 as hexadecimal digits.
pub fn sha256(bytes: &[u8]) -> String {
    hex(&Sha256::digest(bytes))
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Appends the differences between two values, in words.
fn compare(name: &str, theirs: &Value, ours: &Value, differences: &mut Vec<String>) {
    match (theirs, ours) {
        (Value::Object(theirs), Value::Object(ours)) => {
            let only_ours = ours.keys().filter(|key| !theirs.contains_key(*key));
            for key in theirs.keys().chain(only_ours) {
                let name = if name.is_empty() { key.clone() } else { format!("{name}.{key}") };
                compare(&name, theirs.get(key).unwrap_or(&Value::Null), ours.get(key).unwrap_or(&Value::Null), differences);
            }
        }
        _ if theirs == ours => {}
        // The digits of checksums tell a reader nothing.
        (Value::String(theirs), Value::String(_)) if theirs.len() == 64 => differences.push(format!("{name} differs")),
        _ => differences.push(format!("{name} is {theirs} there and {ours} here")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Clone, Debug, PartialEq)]
    struct Two([Vec<f32>; 2]);

    impl Sum for Two {
        fn add(&mut self, later: &Self) {
            self.0.iter_mut().flatten().zip(later.0.iter().flatten()).for_each(|(a, b)| *a += b);
        }
    }

    impl Planes for Two {
        fn planes(&self) -> Vec<&[f32]> {
            self.0.iter().map(Vec::as_slice).collect()
        }
    }

    fn two(_: Range<u32>, planes: Vec<&[f32]>) -> Option<Two> {
        let [a, b] = planes.try_into().ok()?;
        Some(Two([a.to_vec(), b.to_vec()]))
    }

    fn tree() -> PairwiseSum<Two> {
        let mut sum = PairwiseSum::default();
        for first in [0, 1, 2, 5] {
            let value = 0.1 * (1 + first) as f32;
            sum.insert(Node { first, blocks: 1, sum: Two([vec![value; 3], vec![f32::NAN]]) }).unwrap();
        }
        sum
    }

    #[test]
    fn what_is_written_is_read_again_to_the_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("some.part");
        let sum = tree();
        let mut part = Part::new(json!({"seed": 1}), json!([2, 1e-9]));
        part.put_tree("film", &sum);
        part.put("alone", &[4.0]);
        part.write(&path).unwrap();
        let read = Part::read(&path).unwrap();
        assert_eq!((&read.job, &read.state), (&json!({"seed": 1}), &json!([2, 1e-9])));
        assert_eq!(read.get("alone"), Some(&[4.0][..]));
        let nodes = read.tree(&path, "film", Blocks::new(8, 1), two).unwrap();
        let bits = |nodes: &[Node<Two>]| -> Vec<_> {
            let bits = |two: &Two| two.0.iter().flatten().map(|x| x.to_bits()).collect::<Vec<_>>();
            nodes.iter().map(|node| (node.first, node.blocks, bits(&node.sum))).collect()
        };
        assert_eq!(bits(nodes.nodes()), bits(sum.nodes()));
        // Five blocks are fewer than the part has.
        assert!(read.tree(&path, "film", Blocks::new(5, 1), two).is_err());
    }

    #[test]
    fn damage_is_seen() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("some.part");
        let sum = tree();
        let mut part = Part::new(json!({}), json!({}));
        part.put_tree("film", &sum);
        part.write(&path).unwrap();
        let bytes = fs::read(&path).unwrap();
        for length in (0..bytes.len()).step_by(7) {
            assert!(Part::parse(&path, &bytes[..length]).is_err(), "{length} bytes of {}", bytes.len());
        }
        for place in 0..bytes.len() {
            let mut bytes = bytes.clone();
            bytes[place] ^= 4;
            let error = Part::parse(&path, &bytes).map(drop).expect_err("a byte is another").to_string();
            assert!(place < bytes.len() - 32 || error.contains("checksum"), "{error}");
        }
    }

    #[test]
    fn another_job_is_refused_by_what_differs() {
        let ours = json!({"settings": {"seed": 1, "size": [4, 4]}, "scene": {"mesh": sha256(b"a")}, "version": "1"});
        let theirs = json!({"settings": {"seed": 2, "size": [4, 4]}, "scene": {"mesh": sha256(b"b")}, "until": 3});
        let path = Path::new("x.part");
        Part::new(ours.clone(), Value::Null).check(path, &ours).unwrap();
        let said = Part::new(theirs, Value::Null).check(path, &ours).unwrap_err().to_string();
        for part in
            ["settings.seed is 2 there and 1 here", "scene.mesh differs", "until is 3 there and null here", "version is null"]
        {
            assert!(said.contains(part), "{part} in {said}");
        }
        assert!(!said.contains("size"), "{said}");
    }
}
