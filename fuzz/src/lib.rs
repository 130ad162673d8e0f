//! The check of all targets. For any bytes, a reader returns sound data, or an error with the place, the problem and the cure.

use std::collections::BTreeMap;
use std::path::Path;

use finalgather::error::{Error, Result};
use finalgather::scene::{Files, LoadOptions, World};

/// A sound scene with one file of each kind. A TGA texture is known only by its name. But the first bytes of another format override the name.
const SCENE: [(&str, &[u8]); 5] = [
    ("s.toml", include_bytes!("../seeds/scene/all.toml")),
    ("m.obj", include_bytes!("../seeds/obj/room.obj")),
    ("m.mtl", include_bytes!("../seeds/mtl/all.mtl")),
    ("t.tga", include_bytes!("../seeds/texture/rgb.png")),
    ("e.hdr", include_bytes!("../seeds/environment/sky.hdr")),
];

pub fn check<T>(read: Result<T>) {
    if let Err(error) = read {
        let Error::Input { problem, cure, .. } = &error else { panic!("blames no file: {error}") };
        assert!(!problem.is_empty() && !cure.is_empty(), "{error}");
    }
}

/// Loads a model of these bytes, with the texture `t.png` beside it.
pub fn load_model(name: &str, bytes: &[u8]) {
    let texture = include_bytes!("../seeds/texture/rgb.png").to_vec();
    let files = BTreeMap::from([(name.into(), bytes.to_vec()), ("t.png".into(), texture)]);
    check(World::load_with(Path::new(name), LoadOptions { files: Files::Memory(files), ..LoadOptions::default() }));
}

/// Loads the scene with `bytes` as the contents of file `name`.
pub fn load(name: &str, bytes: &[u8]) {
    let mut files = BTreeMap::from(SCENE.map(|(name, bytes)| (name.into(), bytes.to_vec())));
    files.insert(name.into(), bytes.to_vec());
    for strict in [false, true] {
        let files = Files::Memory(files.clone());
        check(World::load_with(Path::new("s.toml"), LoadOptions { files, strict, ..LoadOptions::default() }));
    }
}
