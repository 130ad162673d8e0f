//! Materials of a glTF file. What pictures do not show goes to [`Material::unshaded`].

use glam::{Affine2, Mat2, Vec2, Vec3, vec2};
use gltf::json::extensions::material as extension;
use gltf::json::material::{AlphaMode, Material as JsonMaterial};
use gltf::json::texture::Info;
use gltf::json::validation::Checked;

use super::buffers::Buffers;
use super::images::Images;
use super::primitive::{Look, V_UP};
use crate::error::Result;
use crate::scene::format::Loader;
use crate::scene::{Material, Opacity, Surface};

/// A metal of this much and no more roughness is a mirror.
const METAL: f32 = 0.99;
const SHARP: f32 = 0.05;
/// What transmits this much with no more roughness is glass.
const CLEAR: f32 = 0.5;
const CLEAR_ROUGHNESS: f32 = 0.1;

/// All materials of a file, in its order.
pub struct FileMaterials {
    pub list: Vec<Material>,
    looks: Vec<Look>,
}

impl FileMaterials {
    pub fn load(loader: &mut Loader, buffers: &Buffers) -> Result<Self> {
        let mut images = Images::new(buffers);
        let mut materials = Self { list: Vec::new(), looks: Vec::new() };
        for (index, json) in buffers.document.root.materials.iter().enumerate() {
            let (material, coordinates) =
                MaterialReading { json, images: &mut images, coordinates: None, unshaded: Vec::new() }.load(loader, index)?;
            materials.looks.push(Look { material: index as u32, coordinates });
            materials.list.push(material);
        }
        Ok(materials)
    }

    /// How a material of the file is laid on a primitive. `None` is the default of glTF, which is white.
    pub fn look(&mut self, buffers: &Buffers, index: Option<usize>) -> Result<Look> {
        if let Some(index) = index {
            return buffers.document.entry(&self.looks, "materials", index).copied();
        }
        let white = buffers.document.root.materials.len();
        if self.list.len() == white {
            self.list.push(Material { albedo: Vec3::ONE, ..Material::default() });
        }
        Ok(Look { material: white as u32, coordinates: None })
    }
}

/// A material that is being read.
pub(super) struct MaterialReading<'a, 'b, 'c> {
    pub json: &'a JsonMaterial,
    pub images: &'a mut Images<'b, 'c>,
    /// Those of the textures so far. All textures of a material share them.
    pub coordinates: Option<(u32, Affine2)>,
    unshaded: Vec<String>,
}

impl MaterialReading<'_, '_, '_> {
    /// The material, and the coordinates of its textures.
    fn load(mut self, loader: &mut Loader, index: usize) -> Result<(Material, Option<(u32, Affine2)>)> {
        let json = self.json;
        let none = extension::Material::default();
        let extensions = json.extensions.as_ref().unwrap_or(&none);
        let base = &json.pbr_metallic_roughness;
        let (factor, texture) = match &extensions.pbr_specular_glossiness {
            Some(old) => (old.diffuse_factor.0, old.diffuse_texture.as_ref()),
            None => (base.base_color_factor.0, base.base_color_texture.as_ref()),
        };
        let mut albedo = shares(factor);
        let mut albedo_texture = None;
        if let Some(info) = texture {
            albedo_texture = self.images.texture(loader, info.index.value())?;
            self.coordinates = albedo_texture.map(|_| coordinates_of(info));
        }
        let (emission, emission_texture) = self.emission(loader, extensions)?;
        let surface = self.surface(extensions, albedo, texture.is_some());
        self.note_transmission(extensions, surface);
        let gloss = if surface == Surface::Diffuse { self.gloss(loader, extensions)? } else { None };
        let normal_map = match surface {
            Surface::Diffuse => self.normal_map(loader)?,
            _ => {
                if let Some(normal) = &json.normal_texture {
                    self.note(format!("normal map {}", self.images.name(normal.index.value())));
                }
                None
            }
        };
        self.note_rest(extensions);
        let opacity = match surface {
            Surface::Glass { .. } => Opacity::default(),
            _ => self.opacity(loader, factor[3], albedo_texture),
        };
        if matches!(surface, Surface::Glass { .. }) {
            albedo = Vec3::ONE;
        }
        let name = json.name.clone().filter(|name| !name.is_empty()).unwrap_or_else(|| format!("material {index}"));
        let two_sided = json.double_sided && emission != Vec3::ZERO;
        let material = Material {
            name,
            albedo,
            emission,
            two_sided,
            albedo_texture,
            opacity,
            emission_texture,
            gloss,
            normal_map,
            surface,
            unshaded: self.unshaded,
        };
        Ok((material, self.coordinates))
    }

    /// How much light it stops, by the alpha of its base colour. An opaque material ignores it.
    fn opacity(&self, loader: &Loader, alpha: f32, texture: Option<usize>) -> Opacity {
        let cutoff = match self.json.alpha_mode {
            Checked::Valid(AlphaMode::Mask) => Some(self.json.alpha_cutoff.map_or(0.5, |cutoff| cutoff.0)),
            Checked::Valid(AlphaMode::Blend) => None,
            _ => return Opacity::default(),
        };
        let share = if alpha.is_finite() { alpha.clamp(0.0, 1.0) } else { 1.0 };
        let opacity = Opacity { share, texture: texture.filter(|&texture| loader.textures.list[texture].has_alpha()), cutoff };
        if opacity.is_partial() { opacity } else { Opacity::default() }
    }

    /// The emission, and the texture that multiplies it.
    fn emission(&mut self, loader: &mut Loader, extensions: &extension::Material) -> Result<(Vec3, Option<usize>)> {
        let strength = extensions.emissive_strength.as_ref().map_or(1.0, |strength| strength.emissive_strength.0);
        let radiance = |factor: f32| if factor > 0.0 { (factor * strength).clamp(0.0, f32::MAX) } else { 0.0 };
        let emission = Vec3::from(self.json.emissive_factor.0.map(radiance));
        let Some(info) = self.json.emissive_texture.as_ref().filter(|_| emission != Vec3::ZERO) else {
            return Ok((emission, None));
        };
        let (texture, coordinates) = (info.index.value(), coordinates_of(info));
        if self.coordinates.is_none_or(|others| others == coordinates) {
            let Some(texture) = self.images.texture(loader, texture)? else { return Ok((emission, None)) };
            if !loader.textures.shines(texture) {
                return Ok((Vec3::ZERO, None));
            }
            self.coordinates = Some(coordinates);
            return Ok((emission, Some(texture)));
        }
        let mean = self.images.mean(loader, texture)?.unwrap_or(Vec3::ONE);
        let name = self.images.name(texture);
        if (emission * mean).max_element() < Material::LEAST_GLOW {
            self.note(format!("emission texture {name}, with other coordinates than the base colour and too dark for a lamp"));
            return Ok((Vec3::ZERO, None));
        }
        self.note(format!("emission texture {name}, with other coordinates than the base colour: the mean colour shines"));
        Ok((emission * mean, None))
    }

    fn surface(&self, extensions: &extension::Material, base: Vec3, textured: bool) -> Surface {
        let json = &self.json.pbr_metallic_roughness;
        let (metallic, roughness) = (json.metallic_factor.0, json.roughness_factor.0);
        if extensions.pbr_specular_glossiness.is_some() || json.metallic_roughness_texture.is_some() || textured {
            return Surface::Diffuse;
        }
        let transmission = extensions.transmission.as_ref().filter(|transmission| transmission.transmission_texture.is_none());
        if transmission.is_some_and(|transmission| transmission.transmission_factor.0 > CLEAR) && roughness < CLEAR_ROUGHNESS {
            return glass(extensions, base);
        }
        if metallic >= METAL && roughness < SHARP { Surface::Mirror } else { Surface::Diffuse }
    }

    fn note(&mut self, what: String) {
        self.unshaded.push(what);
    }

    pub(super) fn note_texture(&mut self, what: &str, info: Option<&Info>) {
        if let Some(info) = info {
            let name = self.images.name(info.index.value());
            self.note(format!("{what} {name}"));
        }
    }

    /// Notes what is not shown of transmission.
    fn note_transmission(&mut self, extensions: &extension::Material, surface: Surface) {
        if let Some(transmission) = extensions.transmission.as_ref().filter(|_| surface == Surface::Diffuse) {
            self.note(format!("transmission {}", transmission.transmission_factor.0));
        }
    }

    /// Notes the rest of what is not shown.
    fn note_rest(&mut self, extensions: &extension::Material) {
        if extensions.unlit.is_some() {
            self.note("unlit".to_owned());
        }
        for name in extensions.others.keys() {
            if let Some(name) = name.strip_prefix("KHR_materials_").or_else(|| name.strip_prefix("KHR_technique_")) {
                self.note(name.to_owned());
            }
        }
    }
}

/// Glass of this base colour. Of a body, the mean path through it filters too.
fn glass(extensions: &extension::Material, base: Vec3) -> Surface {
    let index = extensions.ior.as_ref().map_or(Surface::GLASS_INDEX, |ior| ior.ior.0).clamp(1.0, 10.0);
    match extensions.volume.as_ref().filter(|volume| volume.thickness_factor.0 > 0.0) {
        Some(volume) => {
            let depth = volume.thickness_factor.0 / volume.attenuation_distance.0;
            let body = if depth.is_finite() && depth > 0.0 {
                Vec3::from(volume.attenuation_color.0).clamp(Vec3::ZERO, Vec3::ONE).powf(depth)
            } else {
                Vec3::ONE
            };
            Surface::Glass { index, filter: base * body }
        }
        // A sheet has one face, which applies the square root.
        None => Surface::Glass { index: 1.0, filter: base * base },
    }
}

/// Shares of light, from a factor that may be out of range.
fn shares([r, g, b, _]: [f32; 4]) -> Vec3 {
    Vec3::new(r, g, b).clamp(Vec3::ZERO, Vec3::ONE)
}

/// The set of coordinates of a texture, and what becomes of them.
pub(super) fn coordinates_of(info: &Info) -> (u32, Affine2) {
    let Some(transform) = info.extensions.as_ref().and_then(|extensions| extensions.texture_transform.as_ref()) else {
        return (info.tex_coord, V_UP);
    };
    let scale = Mat2::from_diagonal(Vec2::from(transform.scale.0));
    // Counter-clockwise where v points down.
    let (sin, cos) = transform.rotation.0.sin_cos();
    let rotation = Mat2::from_cols(vec2(cos, -sin), vec2(sin, cos));
    let own = Affine2::from_mat2_translation(rotation * scale, Vec2::from(transform.offset.0));
    (transform.tex_coord.unwrap_or(info.tex_coord), V_UP * own)
}
