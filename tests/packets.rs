//! Packets of rays against single rays: along shared directions, towards lights, and through cut-outs. Packets of a picture hold each pixel once.

mod common;

use common::{Model, cornell, directions, fifty_objects, points_on};
use finalgather::points::GatherPoint;
use finalgather::points::packets::{Ends, PacketConsumer, PointHits, PointPacket, SubsetPackets, cast, packets};
use finalgather::scene::{Bvh, Chance, Hit, LANES, Lanes, NO_TRIANGLE, RAY_OFFSET, Rays, Scene, ShadowPacket};
use finalgather::settings::Sequence;
use glam::{Vec3, vec3};

fn numbered(points: &[GatherPoint]) -> Vec<(u32, GatherPoint)> {
    (0..).zip(points.iter().copied()).collect()
}

/// Keeps the hits of each lane along each direction. `None` where it does not count.
struct Hits;

impl PacketConsumer for Hits {
    type Sums = Vec<[Option<Option<Hit>>; LANES]>;

    fn take(&self, _: &PointPacket, kept: &mut Self::Sums, direction: usize, found: &PointHits) {
        for lane in (0..LANES).filter(|lane| found.counting >> lane & 1 == 1) {
            let triangle = found.hits.triangles[lane];
            let hit = Hit { triangle: triangle as usize, distance: found.hits.distances[lane] };
            kept[direction][lane] = Some((triangle != NO_TRIANGLE).then_some(hit));
        }
    }
}

/// The hit of each point along each direction, and whether it counts.
fn hits(scene: &Scene, points: &[GatherPoint], directions: &[Ends]) -> Vec<Vec<Option<Option<Hit>>>> {
    let bvh = Bvh::new(&scene.mesh);
    let packets = packets(&numbered(points));
    let mut found = vec![vec![[None; LANES]; directions.len()]; packets.len()];
    cast(Rays::new(scene, &bvh), &packets, directions, &mut found, &Hits);
    let mut all = vec![vec![None; directions.len()]; points.len()];
    for (packet, found) in packets.iter().zip(found) {
        for (lane, &point) in packet.points().iter().enumerate() {
            (0..directions.len()).for_each(|direction| all[point as usize][direction] = found[direction][lane]);
        }
    }
    all
}

/// Compares packets with single rays. A ray through an edge may have either triangle, so a millionth of distance is allowed, and few rays may differ.
fn compare(name: &str, scene: &Scene, points: &[GatherPoint], vectors: &[finalgather::direction::Direction]) {
    let bvh = Bvh::new(&scene.mesh);
    let rays = Rays::new(scene, &bvh);
    let ends: Vec<Ends> = vectors.iter().map(Ends::new).collect();
    let (mut all, mut met, mut other) = (0, 0, 0);
    for (point, found) in points.iter().zip(hits(scene, points, &ends)) {
        for ((direction, end), found) in vectors.iter().zip(&ends).zip(found) {
            let vector = end.vector(point.surface_normal.dot(direction.vector) < 0.0);
            let Some(found) = found else {
                assert_eq!(point.cosine(vector), 0.0, "{name}: a direction that counts is left out at {point:?}");
                continue;
            };
            let origin = point.position + RAY_OFFSET * point.surface_normal;
            let expected = rays.nearest(origin, vector, None, Chance::of_direction(direction.number));
            all += 1;
            met += usize::from(expected.is_some());
            let same = match (found, expected) {
                (None, None) => true,
                (Some(found), Some(expected)) => (found.distance - expected.distance).abs() <= 1e-6,
                _ => false,
            };
            other += usize::from(!same);
        }
    }
    eprintln!("{name}: {other} of {all} rays differ, {met} meet something");
    assert!(met > all / 20, "{name}: {met} of {all} meet something");
    assert!(other <= all / 20_000, "{name}: {other} of {all}");
}

#[test]
fn parallel_rays_meet_what_single_rays_meet() {
    let r2 = directions(Sequence::R2, 64);
    for (name, scene) in [("cornell", cornell()), ("fifty objects", fifty_objects())] {
        compare(name, &scene, &points_on(&scene, 4000), &r2);
    }
}

#[test]
fn axes_and_diagonals_are_directions_too() {
    let scene = cornell();
    let mut along = directions(Sequence::R2, 14);
    let signs = [1.0, -1.0];
    let axes = Vec3::AXES.into_iter().flat_map(|axis| signs.map(|sign| sign * axis));
    let diagonals = signs.into_iter().flat_map(|x| signs.into_iter().flat_map(move |y| signs.map(|z| vec3(x, y, z).normalize())));
    along.iter_mut().zip(axes.chain(diagonals)).for_each(|(direction, vector)| direction.vector = vector);
    compare("axes and diagonals", &scene, &points_on(&scene, 2000), &along);
}

/// Each pane takes its share of the directions, the same ones as for single rays.
#[test]
fn cut_outs_stop_the_same_rays() {
    let mut model = Model::new();
    let pane = model.material(Vec3::ONE, Vec3::ZERO);
    model.scene.materials[pane as usize].opacity.share = 0.5;
    for height in [-0.2, 0.1, 0.4] {
        model.plate(height * Vec3::Y, Vec3::Z, Vec3::X, pane);
    }
    model.plate(-0.6 * Vec3::Y, Vec3::Z, Vec3::X, 0);
    model.sphere(vec3(0.1, 0.6, 0.0), 0.2, 12, false, 0);
    let scene = model.finish();
    compare("panes", &scene, &points_on(&scene, 1000), &directions(Sequence::R2, 64));
}

/// Points that have no neighbour are packets of few.
#[test]
fn a_packet_may_have_few_points() {
    let scene = cornell();
    for count in [1, 2, 15, 16, 17] {
        let points = points_on(&scene, count);
        let packets = packets(&numbered(&points));
        assert_eq!(packets.iter().map(|packet| packet.points().len()).sum::<usize>(), points.len());
        compare("few", &scene, &points, &directions(Sequence::R2, 32));
    }
    assert!(packets(&[]).is_empty());
}

/// Shadow rays towards one place from all sides, as many of each packet as it has points.
#[test]
fn shadow_rays_are_stopped_where_single_rays_are() {
    let mut model = Model::new();
    let pane = model.material(Vec3::ONE, Vec3::ZERO);
    model.scene.materials[pane as usize].opacity.share = 0.25;
    model.plate(0.1 * Vec3::Y, 0.5 * Vec3::Z, 0.5 * Vec3::X, pane);
    model.plate(0.15 * Vec3::Y, 0.3 * Vec3::Z, 0.3 * Vec3::X, pane);
    model.plate(-0.6 * Vec3::Y, Vec3::Z, Vec3::X, 0);
    model.cuboid(vec3(0.3, 0.3, 0.2), Vec3::splat(0.1), 0.3, false, 0);
    let scenes = [("opaque", fifty_objects(), 1.0), ("panes", model.finish(), 0.3)];
    for (name, scene, shares) in scenes {
        let (bvh, points) = (Bvh::new(&scene.mesh), points_on(&scene, 3000));
        let rays = Rays::new(&scene, &bvh);
        let (mut all, mut stopped, mut partly, mut other) = (0, 0, 0, 0);
        for packet in packets(&numbered(&points)) {
            for place in [vec3(0.05, 0.55, -0.1), vec3(-0.7, 0.02, 0.3), vec3(0.31, 0.32, 0.21)] {
                let (found, expected) = transmittances(&rays, &packet, place);
                for lane in 0..packet.points().len() {
                    all += 1;
                    stopped += usize::from(expected[lane] == 0.0);
                    partly += usize::from(expected[lane] > 0.0 && expected[lane] < 1.0);
                    other += usize::from((found[lane] - expected[lane]).abs() > 1e-5);
                }
                assert!((packet.points().len()..LANES).all(|lane| found[lane] == 0.0), "{name}: a ray of no point arrives");
            }
        }
        eprintln!("{name}: {other} of {all} differ; {stopped} are stopped, {partly} partly");
        assert!(stopped > all / 20 && stopped < all, "{name}: {stopped} of {all} are stopped");
        assert!(shares == 1.0 || partly > all / 20, "{name}: {partly} of {all} are stopped partly");
        assert!(other <= all / 2000, "{name}: {other} of {all}");
    }
}

/// The light that passes from each point of a packet to a place: by the packet, and by single rays.
fn transmittances(rays: &Rays, packet: &PointPacket, place: Vec3) -> (Lanes, Lanes) {
    let ways: [Vec3; LANES] = std::array::from_fn(|lane| place - packet.rays().origin(lane));
    let count = packet.points().len();
    let shadow = ShadowPacket {
        origins: packet.rays(),
        directions: [0, 1, 2].map(|axis| ways.map(|way| way.normalize()[axis])),
        reaches: std::array::from_fn(|lane| if lane < count { ways[lane].length() } else { -1.0 }),
    };
    let found = if rays.meet_cut_outs() {
        rays.transmittance_of_packet::<true>(&shadow)
    } else {
        rays.transmittance_of_packet::<false>(&shadow)
    };
    let single = |lane: usize| rays.transmittance(packet.rays().origin(lane), ways[lane].normalize(), ways[lane].length());
    (found, std::array::from_fn(|lane| if lane < count { single(lane) } else { 0.0 }))
}

/// Whatever the picture's size: each pixel with a point is in one packet of its own subset.
#[test]
fn packets_of_a_picture_hold_each_pixel_once() {
    for (size, stride) in [([37u32, 23u32], 1), ([37, 23], 4), ([16, 16], 4), ([3, 2], 4), ([64, 48], 2)] {
        let pixel = |i: u32| {
            let [x, y] = [i % size[0], i / size[0]];
            // A floor, with a step in it and holes.
            let height = if x > size[0] / 2 { 0.3 } else { 0.0 };
            let point = GatherPoint::flat(vec3(x as f32 / 64.0, height, y as f32 / 64.0), Vec3::Y);
            (!(x + 3 * y).is_multiple_of(29)).then_some(point)
        };
        let points: Vec<_> = (0..size[0] * size[1]).map(pixel).collect();
        for packets in [SubsetPackets::of_picture(&points, size, stride), SubsetPackets::of_list(&points, size, stride)] {
            assert_eq!((packets.subsets.len(), packets.places), ((stride * stride) as usize, points.len()));
            let mut times = vec![0; points.len()];
            for (subset, packets) in (0..).zip(&packets.subsets) {
                for &point in packets.iter().flat_map(PointPacket::points) {
                    let [x, y] = [point % size[0], point / size[0]];
                    assert_eq!(y % stride * stride + x % stride, subset, "pixel {point} of {size:?}");
                    times[point as usize] += 1;
                }
            }
            assert!(times.iter().zip(&points).all(|(&times, point)| times == i32::from(point.is_some())), "{size:?} by {stride}");
        }
    }
}
