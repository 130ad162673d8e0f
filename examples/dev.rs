use finalgather::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let mut scene = scene::Scene::load(a[1].as_ref()).unwrap();
    let mut s = scene.settings.clone();
    for kv in &a[3..] {
        let (k, v) = kv.split_once('=').unwrap();
        match k {
            "size" => s.size = [v.parse().unwrap(); 2],
            "n" => s.directions = v.parse().unwrap(),
            "layer" => s.layer_size = v.parse().unwrap(),
            "photons" => s.photons = v.parse().unwrap(),
            "cells" => s.grid_cells = v.parse().unwrap(),
            "lights" => s.light_samples = v.parse().unwrap(),
            "shadow" => s.shadow_size = v.parse().unwrap(),
            "stop" => s.stop_fraction = v.parse().unwrap(),
            "seed" => s.seed = v.parse().unwrap(),
            "seq" => {
                s.sequence = match v {
                    "random" => settings::Sequence::Random,
                    "sobol" => settings::Sequence::Sobol,
                    _ => settings::Sequence::R2,
                }
            }
            _ => panic!("{k}"),
        }
    }
    scene.settings = s.clone();
    let gpu = gpu::Gpu::headless(gpu::Backend::Auto, gpu::DeviceChoice::Auto).unwrap();
    let mut r = render::Render::new(&gpu, &scene, &s).unwrap();
    while !r.is_done() {
        r.step().unwrap();
    }
    let im = r.picture();
    println!("{:?}", r.statistics());
    let o = image::WriteOptions { exposure: s.exposure, metadata: None };
    im.write(format!("{}.exr", a[2]).as_ref(), &o).unwrap();
    im.write(format!("{}.png", a[2]).as_ref(), &o).unwrap();
}
