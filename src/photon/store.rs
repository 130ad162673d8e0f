//! Where photons leave their flux: the interface of the grid and the atlas.

use glam::Vec3;

use crate::scene::{LANES, Lanes, Mesh, NO_TRIANGLE, PacketHits, of_lane};

/// Sums the flux of photons at surfaces, and estimates irradiance from it. Lengths are in unit space.
pub trait PhotonStore: Sync {
    /// The sum to which a photon adds that meets a triangle of the traced mesh at `position`, along the unit vector `direction`.
    fn index_of_hit(&self, mesh: &Mesh, triangle: usize, position: Vec3, direction: Vec3) -> usize;

    /// Adds the flux of a photon to the sum `index`.
    fn add_flux(&mut self, index: usize, flux: Vec3);

    /// Called after the last photon of a map.
    fn settle(&mut self) {}

    /// Removes the flux, for new photons. What is known of the surfaces stays.
    fn clear_flux(&mut self);

    /// Irradiance at a hit of a triangle of the gathered mesh, on its front or its back.
    fn irradiance_of_hit(&self, mesh: &Mesh, triangle: usize, position: Vec3, front: bool) -> Vec3;

    /// The same of all hits of a packet, at these positions: red, green and blue. Without meaning where there is no hit.
    fn irradiance_of_packet(&self, mesh: &Mesh, hits: &PacketHits, positions: &[Lanes; 3]) -> [Lanes; 3] {
        let mut irradiance = [[0.0; LANES]; 3];
        for lane in (0..LANES).filter(|&lane| hits.triangles[lane] != NO_TRIANGLE) {
            let (triangle, front) = (hits.triangles[lane] as usize, hits.fronts >> lane & 1 == 1);
            let found = self.irradiance_of_hit(mesh, triangle, Vec3::from(of_lane(positions, lane)), front);
            irradiance.iter_mut().zip(found.to_array()).for_each(|(color, found)| color[lane] = found);
        }
        irradiance
    }
}
