//! Checksums of a scene. Scenes with equal checksums are the same to every stage.

use serde_json::{Value, json};

use super::Scene;
use crate::blocks::sha256;

impl Scene {
    /// One checksum for each part. The camera and the settings are left out.
    pub fn digest(&self) -> Value {
        let mut mesh: Vec<u8> = Vec::new();
        mesh.extend(bytemuck::cast_slice(&self.mesh.positions));
        mesh.extend(bytemuck::cast_slice(&self.mesh.normals));
        mesh.extend(bytemuck::cast_slice(&self.mesh.uvs));
        mesh.extend(bytemuck::cast_slice(&self.mesh.lightmap_uvs));
        mesh.extend(bytemuck::cast_slice(&self.mesh.colors));
        for triangle in &self.mesh.triangles {
            let [a, b, c] = triangle.vertices;
            mesh.extend(bytemuck::bytes_of(&[a, b, c, triangle.material]));
        }
        let mut textures: Vec<u8> = Vec::new();
        for texture in &self.textures {
            textures.extend(bytemuck::bytes_of(&[texture.width, texture.height]));
            textures.extend(texture.texels.as_flattened());
            textures.extend(format!("{:?}", texture.sampler).bytes());
        }
        let mut digest = json!({
            "mesh": sha256(&mesh),
            // Debug prints different text for floats with different bits.
            "materials": sha256(format!("{:?}", self.materials).as_bytes()),
            "textures": sha256(&textures),
            "environment": self.environment.as_ref().map(|environment| environment.digest()),
        });
        if !self.lights.is_empty() {
            digest["lights"] = sha256(format!("{:?}", self.lights).as_bytes()).into();
        }
        digest
    }
}
