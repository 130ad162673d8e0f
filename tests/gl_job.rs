//! Jobs started from the library instead of the command line.

mod common;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use common::gpu;
use common::tool::small_scene;
use finalgather::bake::{Plan, RadianceCache};
use finalgather::error::Error;
use finalgather::image::Image;
use finalgather::job::{
    BakeRequest, Ending, Job, JobRequest, Keeping, Outcome, Per, Progress, ReceiverKind, SceneRequest, SharedScene, TaskReport,
    Watch, Work, merge,
};
use finalgather::points::{LightMapOptions, file};
use finalgather::quantity::Quantity;
use serde_json::{Map, json};

fn scene(folder: &Path) -> SceneRequest {
    let settings = json!({ "size": [24, 24], "directions": 64 });
    let settings = settings.as_object().cloned().unwrap_or_else(Map::new);
    SceneRequest { path: small_scene(folder), settings, ..SceneRequest::default() }
}

fn request(scene: SceneRequest, work: Work, outputs: &[PathBuf]) -> JobRequest {
    JobRequest { scene, work, outputs: vec![outputs.to_vec()], memory: None, time: None, device: Default::default() }
}

fn bake(receiver: ReceiverKind, what: Vec<Quantity>) -> BakeRequest {
    BakeRequest {
        receivers: vec![receiver],
        plan: Plan { what, order: 1, gather_bounces: 0, ao_distance: None, radiance_cache: RadianceCache::Photons, memory: 256 },
        light_map: LightMapOptions::default(),
        per: Per::Row,
    }
}

/// Stops once this many directions are done, and keeps what it is told.
#[derive(Default)]
struct Stop {
    after: u64,
    directions: [u64; 2],
    stages: Vec<&'static str>,
    said: Vec<String>,
}

impl Watch for Stop {
    fn stage(&mut self, stage: &'static str) {
        self.stages.push(stage);
    }

    fn say(&mut self, line: &str) {
        self.said.push(line.to_owned());
    }

    fn progress(&mut self, progress: Progress) {
        self.directions = [progress.done, progress.total];
    }

    fn goes_on(&mut self, _: bool) -> bool {
        self.directions[0] < self.after
    }
}

#[test]
fn a_render_is_stopped_and_goes_on() {
    let _turn = gpu();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let run = |name: &str, keeping: &Keeping, watch: &mut dyn Watch| -> Outcome {
        let request = request(scene(folder.path()), Work::Render, &[path(name)]);
        Job::new(request, keeping).unwrap().run(watch).unwrap()
    };
    let outcome = run("one.exr", &Keeping::default(), &mut ());
    let TaskReport::Render { gather, .. } = &outcome.report.task else { panic!("not a render's: {outcome:?}") };
    assert_eq!((outcome.ending, gather.directions), (Ending::Finished, 64));

    let keeping = Keeping { file: Some(path("sums")), resume: true, ..Keeping::default() };
    let mut watch = Stop { after: 32, ..Stop::default() };
    let outcome = run("two.exr", &keeping, &mut watch);
    assert!(outcome.ending == Ending::Stopped && outcome.report.head.interrupted);
    assert_eq!((watch.directions, watch.stages.first()), ([32, 64], Some(&"loading")));
    assert!(watch.said.last().is_some_and(|line| line.starts_with("stopped after 32 of 64")), "{:?}", watch.said);
    assert!(Image::read(&path("two.exr")).unwrap() != Image::read(&path("one.exr")).unwrap(), "it was not stopped");
    let outcome = run("two.exr", &keeping, &mut ());
    assert_eq!((outcome.ending, outcome.outputs), (Ending::Finished, vec![path("two.exr")]));
    assert!(fs::read(path("two.exr")).unwrap() == fs::read(path("one.exr")).unwrap(), "the pictures differ");
}

/// A part says how it was baked, and a merge needs only that and the scene.
#[test]
fn a_bake_is_merged_from_its_request() {
    let _turn = gpu();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let bake = bake(ReceiverKind::Camera, vec![Quantity::Ao]);
    let request = |outputs: &[PathBuf]| request(scene(folder.path()), Work::Bake(bake.clone()), outputs);
    let run = |request, keeping: &Keeping| Job::new(request, keeping).unwrap().run(&mut ()).unwrap();
    run(request(&[path("one.npy")]), &Keeping::default());
    let parts = ["1/2", "2/2"].map(|shard| {
        let file = path(&format!("{}.part", &shard[..1]));
        let shard = finalgather::blocks::Shard::parse(shard, |_| None).unwrap();
        run(request(&[]), &Keeping { shard: Some(shard), file: Some(file.clone()), ..Keeping::default() });
        file
    });
    let output = |name: &str| vec![path(name).to_str().unwrap().to_owned()];
    merge(&parts, &output("merged.npy"), |_| (), &mut ()).unwrap();
    assert!(fs::read(path("merged.npy")).unwrap() == fs::read(path("one.npy")).unwrap(), "the values differ");
    let missing = merge(&parts[..1], &output("half.npy"), |_| (), &mut ());
    assert!(matches!(missing, Err(Error::Usage { .. })), "{missing:?}");
}

#[test]
fn a_setting_that_does_not_exist_is_refused() {
    let _turn = gpu();
    let folder = tempfile::tempdir().unwrap();
    let mut scene = scene(folder.path());
    scene.settings.insert("directoins".into(), 3.into());
    let request = request(scene, Work::Render, &[folder.path().join("a.exr")]);
    let refused = Job::new(request, &Keeping::default()).unwrap().run(&mut ()).map(drop);
    assert!(refused.as_ref().is_err_and(|error| error.to_string().contains("directoins")), "{refused:?}");
}

/// A scene in memory is not read again, and its results need no file. What is written later is what the job itself writes.
#[test]
fn results_stay_in_memory() {
    let _turn = gpu();
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let scene = scene(folder.path());
    Job::new(request(scene.clone(), Work::Render, &[path("one.exr")]), &Keeping::default()).unwrap().run(&mut ()).unwrap();

    let loaded = SharedScene(Arc::new(scene.load(false).unwrap()));
    fs::remove_file(&scene.path).unwrap();
    let files = fs::read_dir(folder.path()).unwrap().count();
    let in_memory = SceneRequest { loaded: Some(loaded.clone()), ..scene };
    let job = || Job::in_memory(request(in_memory.clone(), Work::Render, &[]), &Keeping::default()).unwrap();
    let results = job().run(&mut ()).unwrap().results.unwrap();
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), files, "the job wrote a file");
    results.write(0, &path("two.exr"), &results.display()).unwrap();
    assert!(fs::read(path("two.exr")).unwrap() == fs::read(path("one.exr")).unwrap(), "the files differ");
    let refused = results.write(0, &path("two.npy"), &results.display());
    assert!(matches!(refused, Err(Error::Usage { .. })), "{refused:?}");

    let part = job().run(&mut Stop { after: 32, ..Stop::default() }).unwrap();
    let picture = part.results.as_ref().and_then(|results| results.picture()).unwrap();
    assert!(part.ending == Ending::Stopped && picture != results.picture().unwrap(), "it was not stopped");
    let nothing = job().run(&mut Stop::default()).unwrap();
    assert!(nothing.ending == Ending::Stopped && nothing.results.is_none(), "there are results before the first direction");
    assert_eq!(Arc::strong_count(&loaded.0), 2, "a job keeps the scene");
}

/// Points in memory are those of a file.
#[test]
fn points_in_memory_are_those_of_a_file() {
    let _turn = gpu();
    let folder = tempfile::tempdir().unwrap();
    let scene = scene(folder.path());
    fs::write(folder.path().join("a.csv"), "0,0.5,0,0,1,0\n0.25,0.5,0.25,1,0,2\n").unwrap();
    let rows = [[0.0, 0.5, 0.0, 0.0, 1.0, 0.0], [0.25, 0.5, 0.25, 1.0, 0.0, 2.0]];
    let list = ReceiverKind::PointList(file::of_rows("rows".as_ref(), rows.into_iter()).unwrap().into());
    let bake = |receiver: ReceiverKind| bake(receiver, vec![Quantity::Irradiance, Quantity::Ao]);
    let values = |receiver: ReceiverKind| {
        let request = request(scene.clone(), Work::Bake(bake(receiver)), &[]);
        Job::in_memory(request, &Keeping::default()).unwrap().run(&mut ()).unwrap().results.unwrap()
    };
    let [of_file, of_list] = [ReceiverKind::Points(folder.path().join("a.csv")), list].map(values);
    let [file, list] = [&of_file, &of_list].map(|results| &results.values()[0]);
    assert_eq!((&file.columns, &file.positions, &file.normals), (&list.columns, &list.positions, &list.normals));
    assert!(file.columns.iter().any(|column| column.samples[0] > 0.0));

    // A shard would have to name them.
    let list = ReceiverKind::PointList(file::of_rows("rows".as_ref(), rows.into_iter()).unwrap().into());
    let shard = finalgather::blocks::Shard::parse("1/2", |_| None).unwrap();
    let keeping = Keeping { shard: Some(shard), file: Some(folder.path().join("1.part")), ..Keeping::default() };
    let refused = Job::new(request(scene.clone(), Work::Bake(bake(list)), &[]), &keeping).unwrap().run(&mut ());
    assert!(matches!(&refused, Err(Error::Usage { problem, .. }) if problem.contains("points are in memory")), "{refused:?}");
}
