//! Gloss and normal maps of a glTF material.

use glam::Vec3;
use gltf::json::extensions::{material as extension, texture};
use gltf::json::texture::Info;

use super::material::{MaterialReading, coordinates_of};
use crate::error::Result;
use crate::scene::format::Loader;
use crate::scene::{Gloss, NormalMap};

impl MaterialReading<'_, '_, '_> {
    /// The gloss of a material that is no mirror and no glass.
    pub(super) fn gloss(&mut self, loader: &mut Loader, extensions: &extension::Material) -> Result<Option<Gloss>> {
        if extensions.unlit.is_some() {
            return Ok(None);
        }
        if let Some(old) = &extensions.pbr_specular_glossiness {
            if old.specular_glossiness_texture.is_some() {
                // Without the texture its factors would make all of it a mirror.
                self.note_texture("specular-glossiness texture", old.specular_glossiness_texture.as_ref());
                return Ok(None);
            }
            let specular = Vec3::from(old.specular_factor.0).clamp(Vec3::ZERO, Vec3::ONE);
            let roughness = 1.0 - old.glossiness_factor.0.clamp(0.0, 1.0);
            return Ok((specular != Vec3::ZERO).then_some(Gloss { roughness, specular, ..Gloss::default() }));
        }
        let base = &self.json.pbr_metallic_roughness;
        let mut gloss = Gloss {
            roughness: base.roughness_factor.0.clamp(0.0, 1.0),
            metallic: base.metallic_factor.0.clamp(0.0, 1.0),
            specular: self.specular(extensions),
            texture: None,
        };
        if let Some(info) = &base.metallic_roughness_texture {
            gloss.texture = self.data_texture(loader, "metallic-roughness texture", info)?;
            if gloss.texture.is_none() {
                // The factors alone would make a metal of all of it.
                return Ok(None);
            }
        }
        Ok((gloss.metallic > 0.0 || gloss.specular != Vec3::ZERO).then_some(gloss))
    }

    /// Reflectance of the dielectric straight on, by its index of refraction and by `KHR_materials_specular`.
    fn specular(&mut self, extensions: &extension::Material) -> Vec3 {
        let of_index = |index: f32| ((index - 1.0) / (index + 1.0)).powi(2);
        let straight = extensions.ior.as_ref().map_or(Gloss::SPECULAR, |ior| of_index(ior.ior.0));
        let Some(specular) = &extensions.specular else { return Vec3::splat(straight).clamp(Vec3::ZERO, Vec3::ONE) };
        self.note_texture("specular texture", specular.specular_texture.as_ref());
        self.note_texture("specular colour texture", specular.specular_color_texture.as_ref());
        let color = (straight * Vec3::from(specular.specular_color_factor.0)).clamp(Vec3::ZERO, Vec3::ONE);
        color * specular.specular_factor.0.clamp(0.0, 1.0)
    }

    pub(super) fn normal_map(&mut self, loader: &mut Loader) -> Result<Option<NormalMap>> {
        let Some(normal) = &self.json.normal_texture else { return Ok(None) };
        // Of this texture alone the transform comes as JSON.
        let transform = normal.extensions.as_ref().and_then(|extensions| extensions.others.get("KHR_texture_transform"));
        let texture_transform = transform.and_then(|transform| serde_json::from_value(transform.clone()).ok());
        let extensions = Some(texture::Info { texture_transform, ..texture::Info::default() });
        let info = Info { index: normal.index, tex_coord: normal.tex_coord, extensions, extras: Default::default() };
        let texture = self.data_texture(loader, "normal map", &info)?;
        Ok(texture.map(|texture| NormalMap { texture, scale: normal.scale }))
    }

    /// The index of a texture of numbers. `None` if it cannot be read, or lies in another way than the textures before; then it is noted.
    fn data_texture(&mut self, loader: &mut Loader, what: &str, info: &Info) -> Result<Option<usize>> {
        let coordinates = coordinates_of(info);
        if self.coordinates.is_some_and(|others| others != coordinates) {
            self.note_texture(&format!("{what} with other coordinates than the base colour,"), Some(info));
            return Ok(None);
        }
        let texture = self.images.texture(loader, info.index.value())?;
        if texture.is_some() {
            self.coordinates = Some(coordinates);
        }
        Ok(texture)
    }
}
