//! All shader programs, from the sources in `glsl/`. [`variants`] lists them: those named here, and one for each [`Finder`] and [`Consumer`].

use std::fs;
use std::path::Path;
use std::sync::LazyLock;

use crate::gpu::{ShaderSource, replace_shader_text};
use crate::harmonics::MAX_ORDER;
use crate::settings::PhotonMapKind;

macro_rules! includes {
    ($($name:literal)*) => { &[$(($name, include_str!(concat!("../glsl/", $name)))),*] };
}

const INCLUDES: &[(&str, &str)] = includes![
    "consumer/harmonics.glsl" "consumer/hemisphere.glsl" "consumer/irradiance.glsl" "consumer/record.glsl"
    "finder/layers.glsl" "finder/rays.glsl" "finder/stored.glsl"
    "include/albedo.glsl" "include/bvh.glsl" "include/gloss.glsl" "include/harmonics.glsl" "include/hits.glsl" "include/layer.glsl" "include/layer_store.glsl"
    "include/octahedral.glsl" "include/packed_surface.glsl" "include/photon_atlas.glsl" "include/photon_grid.glsl" "include/points.glsl" "include/radiance.glsl"
    "include/surface.glsl" "include/vertex_cache.glsl"
];

macro_rules! shaders {
    ($($name:ident: $vertex:literal, $fragment:literal $(, $define:literal)*;)*) => {
        $(pub static $name: LazyLock<ShaderSource> = LazyLock::new(|| ShaderSource {
            name: $fragment,
            vertex: include_str!(concat!("../glsl/", $vertex, ".vert")),
            fragment: include_str!(concat!("../glsl/", $fragment, ".frag")),
            defines: vec![$($define.to_owned()),*],
            includes: INCLUDES,
        });)*

        static NAMED: &[&LazyLock<ShaderSource>] = &[$(&$name),*];
    };
}

shaders! {
    VISIBLE_POINTS: "surface", "visible_points";
    DIRECT: "fullscreen", "direct", "BATCH 8", "ANY_HIT";
    PHOTON_MAP: "fullscreen", "photon_map";
    PEEL: "surface", "peel";
    KILL: "fullscreen", "kill";
    KILL_FARTHEST: "fullscreen", "kill", "FARTHEST";
    KILL_FARTHEST_EARLY: "fullscreen", "kill", "FARTHEST", "EARLY";
    REJECT: "fullscreen", "reject";
    STORE_PEEL: "surface", "store_peel", "BATCH 8";
    STORE_PEEL_FARTHEST: "surface", "store_peel", "BATCH 8", "FARTHEST";
    STORE_APPEND: "surface", "store_append", "BATCH 8";
    STORE_SORT: "fullscreen", "store_sort";
}

/// Most directions in one batch of a shader: its define `BATCH`.
pub const BATCH: usize = 8;
/// Most outputs of a shader, of four floats each: OpenGL 3.3 promises no more.
const TARGETS: usize = 8;
const GATHER: &str = include_str!("../glsl/gather.frag");

/// What `glsl/direct.frag` does besides.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct DirectVariant {
    /// Some lights have no surface.
    pub punctual: bool,
    /// Points may have a lobe.
    pub gloss: bool,
}

impl DirectVariant {
    fn all() -> impl Iterator<Item = Self> {
        [false, true].into_iter().flat_map(|punctual| [false, true].map(|gloss| Self { punctual, gloss }))
    }

    pub fn source(self) -> ShaderSource {
        let mut source = ShaderSource::clone(&DIRECT);
        let flags = [(self.punctual, "PUNCTUAL"), (self.gloss, "GLOSS")];
        source.defines.extend(flags.into_iter().filter(|(set, _)| *set).map(|(_, name)| name.to_owned()));
        source
    }
}

/// The hit finder that `glsl/gather.frag` includes: the file of that name in `glsl/finder/`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finder {
    Layers,
    Rays,
    Stored,
}

/// The consumer of hits that `glsl/gather.frag` includes: a file of `glsl/consumer/`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Consumer {
    Irradiance(HitRadiance),
    /// The same with the sums of points' lobes.
    Gloss(HitRadiance),
    /// `None`: surfaces are black.
    Hemisphere(Option<HitRadiance>),
    IncidentHarmonics(HitRadiance, HarmonicsPass),
    /// `None`: surfaces are black. Otherwise their transfer comes from the vertex cache; `true` with albedo textures.
    TransferHarmonics(Option<bool>, HarmonicsPass),
    Record,
}

/// The source of a hit's radiance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HitRadiance {
    pub source: RadianceSource,
    /// As [`Scene::is_textured`](crate::scene::Scene::is_textured).
    pub textured: bool,
}

/// What holds the irradiance of surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RadianceSource {
    PhotonAtlas,
    PhotonGrid,
    VertexCache,
}

impl From<PhotonMapKind> for RadianceSource {
    fn from(kind: PhotonMapKind) -> Self {
        match kind {
            PhotonMapKind::Surface => Self::PhotonAtlas,
            PhotonMapKind::Grid => Self::PhotonGrid,
        }
    }
}

/// One of the passes that together write all spherical harmonics coefficients of `order` bands.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HarmonicsPass {
    order: usize,
    pass: usize,
}

impl HarmonicsPass {
    /// Number of outputs of all passes together. The rgb triples of the coefficients follow each other without gaps, four floats to an output.
    pub fn targets(order: usize) -> usize {
        (3 * order * order).div_ceil(4)
    }

    /// Number of outputs of this pass.
    pub fn outputs(self) -> usize {
        (Self::targets(self.order) - TARGETS * self.pass).min(TARGETS)
    }

    /// All passes for bands 0 to `order` - 1.
    ///
    /// # Panics
    /// When `order` is 0 or more than [`MAX_ORDER`].
    pub fn all(order: usize) -> impl Iterator<Item = Self> {
        assert!((1..=MAX_ORDER).contains(&order), "{order} bands");
        (0..Self::targets(order).div_ceil(TARGETS)).map(move |pass| Self { order, pass })
    }
}

impl Consumer {
    fn all() -> Vec<Self> {
        let sources = [RadianceSource::PhotonAtlas, RadianceSource::PhotonGrid, RadianceSource::VertexCache];
        let radiance: Vec<_> =
            sources.into_iter().flat_map(|source| [false, true].map(|textured| HitRadiance { source, textured })).collect();
        let mut all = vec![Self::Record, Self::Hemisphere(None)];
        all.extend(radiance.iter().flat_map(|&radiance| [Self::Irradiance(radiance), Self::Hemisphere(Some(radiance))]));
        // Bakes have no lobes.
        let of_pictures = radiance.iter().filter(|radiance| radiance.source != RadianceSource::VertexCache);
        all.extend(of_pictures.map(|&radiance| Self::Gloss(radiance)));
        for pass in (1..=MAX_ORDER).flat_map(HarmonicsPass::all) {
            all.extend(radiance.iter().map(|&radiance| Self::IncidentHarmonics(radiance, pass)));
            all.extend([None, Some(false), Some(true)].map(|textured| Self::TransferHarmonics(textured, pass)));
        }
        all
    }

    fn defines(self) -> Vec<String> {
        let (file, radiance, pass) = match self {
            Self::Irradiance(radiance) | Self::Gloss(radiance) => ("irradiance", Some(radiance), None),
            Self::Hemisphere(radiance) => ("hemisphere", radiance, None),
            Self::IncidentHarmonics(radiance, pass) => ("harmonics", Some(radiance), Some(pass)),
            Self::TransferHarmonics(textured, pass) => {
                ("harmonics", textured.map(|textured| HitRadiance { source: RadianceSource::VertexCache, textured }), Some(pass))
            }
            Self::Record => ("record", None, None),
        };
        let flags = [
            (radiance.is_some(), "RADIANCE"),
            (radiance.is_some_and(|radiance| radiance.source == RadianceSource::VertexCache), "VERTEX_CACHE"),
            (radiance.is_some_and(|radiance| radiance.source == RadianceSource::PhotonGrid), "PHOTON_GRID"),
            (radiance.is_some_and(|radiance| radiance.textured), "TEXTURED"),
            (matches!(self, Self::TransferHarmonics(..)), "TRANSFER"),
            (matches!(self, Self::Gloss(_)), "GLOSS"),
        ];
        let flags = flags.into_iter().filter(|(set, _)| *set).map(|(_, name)| name.to_owned());
        let pass = pass.map(|HarmonicsPass { order, pass }| [format!("ORDER {order}"), format!("PASS {pass}")]);
        [format!("CONSUMER {file}")].into_iter().chain(flags).chain(pass.into_iter().flatten()).collect()
    }
}

/// The variant of `glsl/gather.frag` for a finder and a consumer.
pub fn gather(finder: Finder, consumer: Consumer) -> ShaderSource {
    let mut defines = consumer.defines();
    let file = match finder {
        Finder::Layers => "layers",
        Finder::Rays => "rays",
        Finder::Stored => "stored",
    };
    defines.extend([format!("BATCH {BATCH}"), format!("FINDER {file}")]);
    ShaderSource { name: "gather", fragment: GATHER, defines, ..DIRECT.clone() }
}

/// All programs of the crate. The tool uses some pairs of finder and consumer. All pairs are listed, so that each stays valid.
pub fn variants() -> Vec<ShaderSource> {
    let finders = [Finder::Layers, Finder::Rays, Finder::Stored];
    let pairs = finders.into_iter().flat_map(|finder| Consumer::all().into_iter().map(move |consumer| gather(finder, consumer)));
    let direct = DirectVariant::all().filter(|&variant| variant != DirectVariant::default()).map(DirectVariant::source);
    NAMED.iter().map(|&source| ShaderSource::clone(source)).chain(direct).chain(pairs).collect()
}

/// Replaces embedded shader sources by the files of a folder laid out as `glsl/`; a missing file keeps the embedded text. For work on shaders.
/// Programs made from now on use the new sources.
pub fn reload(folder: &Path) {
    let vertex = [("surface.vert".to_owned(), VISIBLE_POINTS.vertex), ("fullscreen.vert".to_owned(), DIRECT.vertex)];
    let fragments = NAMED.iter().map(|source| (source.name, source.fragment)).chain([("gather", GATHER)]);
    let fragments = fragments.map(|(name, text)| (format!("{name}.frag"), text));
    let includes = INCLUDES.iter().map(|&(name, text)| (name.to_owned(), text));
    for (path, embedded) in vertex.into_iter().chain(fragments).chain(includes) {
        replace_shader_text(embedded, fs::read_to_string(folder.join(path)).ok());
    }
}
