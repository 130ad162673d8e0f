//! The photon grid on the GL side. Mirrors `glsl/include/photon_grid.glsl`.

use super::grid::{BINS, PhotonGrid};
use crate::error::Result;
use crate::gpu::{Format, Gpu, Texture, Uniform};

/// A grid as a 3D texture: the six bins as tiles, three along x and two along y.
pub struct PhotonTexture {
    texture: Texture,
    grid: PhotonGrid,
}

impl PhotonTexture {
    /// # Errors
    /// [`crate::Error::Usage`] when the grid has more cells than the device's 3D textures.
    pub fn upload(gpu: &Gpu, grid: PhotonGrid) -> Result<Self> {
        let [width, height, depth] = grid.cells.to_array().map(|side| side as usize);
        let mut texels = vec![[0.0f32; 4]; BINS * width * height * depth];
        // Flux and area enter as a quotient: any common unit will do, and a cell's face keeps the numbers near 1.
        let unit = grid.cell_size.powi(-2);
        for (i, sums) in grid.sums.iter().enumerate() {
            let (x, y, z, bin) = (i % width, i / width % height, i / (width * height) % depth, i / (width * height * depth));
            let (column, row) = (bin % 3 * width + x, bin / 3 * height + y);
            texels[(z * 2 * height + row) * 3 * width + column] = sums.map(|sum| sum * unit);
        }
        let size = [3 * width, 2 * height, depth].map(|side| side as u32);
        let texture = Texture::from_texels_3d(gpu, Format::Rgba32F, size, &texels)?;
        Ok(Self { texture, grid })
    }

    /// The uniforms that the shaders read.
    pub fn uniforms(&self) -> [(&'static str, Uniform<'_>); 4] {
        [
            ("photon_grid", Uniform::Texture(&self.texture)),
            ("grid_origin", Uniform::Vec3(self.grid.origin)),
            ("grid_cells", Uniform::Vec3(self.grid.cells.as_vec3())),
            ("grid_density", Uniform::Float(1.0 / self.grid.cell_size)),
        ]
    }
}
