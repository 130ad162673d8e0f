//! The engines of `scripts/cluster`, run for real on this machine: 16 shards, one of them killed midway, and the merged file is to the byte
//! that of one run.
#![cfg(target_os = "linux")]

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::{Write, stderr};
use std::net::TcpListener;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output};
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime};

use serde_json::Value;
use tempfile::TempDir;

/// Of what is waited for; a loaded machine may take a minute.
const PATIENCE: Duration = Duration::from_secs(300);
/// After which a shard is no longer starting, and not yet done.
const MIDWAY: Duration = Duration::from_millis(500);

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The Cornell box in a folder, as `scene.toml`, with settings by which a shard takes a second.
fn folder() -> TempDir {
    let folder = tempfile::tempdir().unwrap();
    for name in ["cornell.obj", "cornell.mtl"] {
        fs::copy(root().join("scenes").join(name), folder.path().join(name)).unwrap();
    }
    let scene = fs::read_to_string(root().join("scenes/cornell.toml")).unwrap();
    let (scene, _) = scene.split_once("[settings]").expect("settings come last");
    let settings = "[settings]\nsize = [64, 64]\ndirections = 1024\nphotons = 10000\n";
    fs::write(folder.path().join("scene.toml"), scene.to_owned() + settings).unwrap();
    folder
}

/// Where the tool is, and the engines as `scripts/setup.sh --tests` installs them.
fn path() -> String {
    let tool = Path::new(env!("CARGO_BIN_EXE_finalgather")).parent().unwrap();
    let python = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().unwrap().join("python/bin");
    format!("{}:{}:{}:/usr/sbin:/sbin", tool.display(), python.display(), std::env::var("PATH").unwrap())
}

fn command(program: impl AsRef<OsStr>, folder: &Path) -> Command {
    let mut command = Command::new(program);
    // What engines keep of sessions goes with the folder.
    command.current_dir(folder).env("PATH", path()).env("TMPDIR", folder);
    command
}

fn success(command: &mut Command) -> Output {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    assert!(output.status.success(), "{command:?}: {:?}: {}{}", output.status, text(&output.stdout), text(&output.stderr));
    output
}

/// Whether all of these are installed. If not, that is said past the test harness, which swallows what passing tests print.
fn installed(engine: &str, programs: &[&str]) -> bool {
    let there = |program: &str| {
        let look = format!("command -v {program} >/dev/null");
        Command::new("sh").env("PATH", path()).args(["-c", &look]).status().unwrap().success()
    };
    let missing: Vec<_> = programs.iter().filter(|program| !there(program)).collect();
    if !missing.is_empty() {
        writeln!(stderr(), "NOT TESTED: {engine}, for {missing:?} are not here; scripts/setup.sh --tests installs them").unwrap();
    }
    missing.is_empty()
}

/// Looks until there is something.
fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let began = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(began.elapsed() < PATIENCE, "waited in vain for {what}");
        sleep(Duration::from_millis(20));
    }
}

/// Kills a process of the tool that gathers a shard of this folder's scene, midway.
fn kill_a_shard(folder: &Path) {
    let tool = Path::new(env!("CARGO_BIN_EXE_finalgather")).canonicalize().unwrap();
    let gathers = |process: &Path| {
        let arguments = text(&fs::read(process.join("cmdline")).unwrap_or_default());
        arguments.contains(folder.to_str().unwrap())
            && arguments.contains("--shard")
            && fs::read_link(process.join("exe")).is_ok_and(|path| path == tool)
    };
    wait_for("a shard to kill", || {
        let mut processes = fs::read_dir("/proc").unwrap().map(|entry| entry.unwrap().path());
        let process = processes.find(|process| gathers(process))?;
        sleep(MIDWAY);
        // One that is done meanwhile spares itself; there are others.
        let id = process.file_name().unwrap();
        (gathers(&process) && Command::new("kill").arg("-KILL").arg(id).status().unwrap().success()).then_some(())
    });
}

/// The parts in a folder, and when each was written.
fn parts(folder: &Path) -> Vec<(PathBuf, SystemTime)> {
    let files = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let parts = files.filter(|path| path.extension().is_some_and(|extension| extension == "part"));
    parts.map(|path| (path.clone(), path.metadata().unwrap().modified().unwrap())).collect()
}

fn assert_as_of_one_run(folder: &Path, merged: &str) {
    success(command("finalgather", folder).args(["render", "scene.toml", "-o", "one.exr"]));
    let [one, merged] = ["one.exr", merged].map(|name| fs::read(folder.join(name)).unwrap());
    assert!(one == merged, "what was merged is not what one run writes");
}

/// A cluster of this machine alone; its daemons end with it, or else with the thread that started it.
struct Slurm {
    folder: PathBuf,
    daemons: Vec<Child>,
}

impl Slurm {
    fn start(folder: &Path) -> Self {
        let mut slurm = Self { folder: folder.join("slurm"), daemons: Vec::new() };
        for name in ["state", "spool"] {
            fs::create_dir_all(slurm.folder.join(name)).unwrap();
        }
        let said = |program: &str, arg: &str| text(&success(command(program, folder).arg(arg)).stdout).trim().to_owned();
        let (host, user) = (said("uname", "-n"), said("id", "-un"));
        let ports = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
        let [controller, node] = ports.map(|listener| listener.local_addr().unwrap().port());
        // Four tasks at a time whatever the machine. What is requeued waits for its credential to expire, by default two minutes.
        let configuration = format!(
            "ClusterName=test\nSlurmUser={user}\nSlurmdUser={user}\n\
             SlurmctldHost={host}(127.0.0.1)\nSlurmctldPort={controller}\nSlurmdPort={node}\n\
             AuthInfo=socket={own}/munge.socket,cred_expire=5\n\
             StateSaveLocation={own}/state\nSlurmdSpoolDir={own}/spool\n\
             SlurmctldPidFile={own}/slurmctld.pid\nSlurmdPidFile={own}/slurmd.pid\n\
             ProctrackType=proctrack/linuxproc\nTaskPlugin=task/none\nMpiDefault=none\n\
             SelectType=select/cons_tres\nSelectTypeParameters=CR_CPU\n\
             SchedulerParameters=batch_sched_delay=0,sched_interval=1\nSlurmdParameters=config_overrides\n\
             NodeName={host} NodeAddr=127.0.0.1 CPUs=4\nPartitionName=all Nodes=ALL Default=YES\n",
            own = slurm.folder.display(),
        );
        fs::write(slurm.folder.join("slurm.conf"), configuration).unwrap();
        success(slurm.command("mungekey").args(["--create", "--keyfile=munge.key"]));
        slurm.daemon(&[
            "munged --foreground --force --key-file=munge.key --socket=munge.socket",
            "--pid-file=munge.pid --log-file=munge.log --seed-file=munge.seed",
        ]);
        wait_for("munged", || slurm.folder.join("munge.socket").exists().then_some(()));
        slurm.daemon(&["slurmctld -D"]);
        slurm.daemon(&["slurmd -D"]);
        wait_for("Slurm", || (slurm.say("sinfo --noheader --format=%T")? == "idle\n").then_some(()));
        slurm
    }

    fn command(&self, program: impl AsRef<OsStr>) -> Command {
        let mut command = command(program, &self.folder);
        command.env("SLURM_CONF", self.folder.join("slurm.conf"));
        command
    }

    /// What a command line of words without blanks says; nothing when it fails.
    fn say(&self, line: &str) -> Option<String> {
        let (program, args) = line.split_once(' ')?;
        let output = self.command(program).args(args.split(' ')).output().ok()?;
        output.status.success().then(|| text(&output.stdout))
    }

    fn daemon(&mut self, line: &[&str]) {
        let words: Vec<_> = line.iter().flat_map(|line| line.split(' ')).collect();
        let log = File::create(self.folder.join(words[0]).with_extension("said")).unwrap();
        let mut command = self.command("setpriv");
        command.args(["--pdeathsig", "TERM"]).args(words).stdout(log.try_clone().unwrap()).stderr(log);
        self.daemons.push(command.spawn().unwrap());
    }

    /// Until the queue is empty.
    fn wait(&self) {
        wait_for("the queue to empty", || self.say("squeue --noheader")?.is_empty().then_some(()));
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        // First what runs, for daemons leave it running.
        self.say("scancel --partition=all");
        let began = Instant::now();
        while began.elapsed() < Duration::from_secs(20) && self.say("squeue --noheader").is_some_and(|jobs| !jobs.is_empty()) {
            sleep(Duration::from_millis(100));
        }
        for mut daemon in self.daemons.drain(..).rev() {
            let _ = Command::new("kill").arg(daemon.id().to_string()).status();
            let _ = daemon.wait();
        }
    }
}

#[test]
fn slurm() {
    if !installed("Slurm", &["munged", "slurmctld", "slurmd", "sbatch", "srun"]) {
        return;
    }
    let folder = folder();
    let folder = folder.path();
    let slurm = Slurm::start(folder);
    success(
        slurm
            .command(root().join("scripts/cluster/slurm.sh"))
            .current_dir(folder)
            .arg("merged.exr")
            .arg("render")
            .arg(folder.join("scene.toml")),
    );
    kill_a_shard(folder);
    // As one that gives way to a job of more weight.
    let preempted = wait_for("a shard to preempt", || {
        let running = slurm.say("squeue --noheader --array --states=RUNNING --format=%i")?;
        let task = running.lines().next()?.to_owned();
        sleep(MIDWAY);
        slurm.say(&format!("scontrol requeue {task}"))?;
        Some(task)
    });
    slurm.wait();
    let logs = || {
        fs::read_dir(folder.join("merged.exr.parts"))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| path.extension().is_some_and(|extension| extension == "log"))
    };
    let logs: Vec<_> = logs().map(|path| fs::read_to_string(path).unwrap()).collect();
    let count = |what: &str| logs.iter().filter(|log| log.contains(what)).count();
    assert_eq!((count("ended with 137: requeued"), count("DUE TO JOB REQUEUE")), (1, 1), "{preempted}: {logs:#?}");
    assert_as_of_one_run(folder, "merged.exr");
}

#[test]
fn open_job_description() {
    if !installed("Open Job Description", &["openjd"]) {
        return;
    }
    let folder = folder();
    let folder = folder.path();
    let mut run = command("openjd", folder);
    run.arg("run").arg(root().join("scripts/cluster/openjd.yaml"));
    run.args(["--step", "Merge", "--run-dependencies", "-p", "Scene=scene.toml", "-p", "Out=merged.exr"]);
    let mut first = run.spawn().unwrap();
    wait_for("two parts", || (parts(folder).len() >= 2).then_some(()));
    kill_a_shard(folder);
    assert!(!first.wait().unwrap().success(), "the first run goes on without the shard that was killed");
    let before = parts(folder);
    success(&mut run);
    let after = parts(folder);
    assert!(before.len() < 16 && before.iter().all(|part| after.contains(part)), "{before:?}, then {after:?}");
    assert_as_of_one_run(folder, "merged.exr");
}

/// No cluster here: against the schema of Kubernetes, and by running what the containers would.
#[test]
fn kubernetes() {
    if !installed("Kubernetes manifests", &["kubernetes-validate"]) {
        return;
    }
    let folder = folder();
    let folder = folder.path();
    let [shards, merge] = ["kubernetes.yaml", "kubernetes_merge.yaml"].map(|name| {
        let path = root().join("scripts/cluster").join(name);
        success(command("kubernetes-validate", folder).args(["--strict", "--kubernetes-version", "1.33"]).arg(&path));
        let json = "import json, sys, yaml; print(json.dumps(yaml.safe_load(open(sys.argv[1]))))";
        serde_json::from_slice::<Value>(&success(command("python", folder).args(["-c", json]).arg(&path)).stdout).unwrap()
    });
    let container = |job: &Value| {
        let container = &job["spec"]["template"]["spec"]["containers"][0];
        let mounted = container["volumeMounts"][0]["mountPath"].as_str().unwrap();
        let words = container["command"]
            .as_array()
            .unwrap()
            .iter()
            .map(|word| word.as_str().unwrap().replace(mounted, folder.to_str().unwrap()));
        let words: Vec<_> = words.collect();
        let mut command = command(&words[0], folder);
        command.args(&words[1..]);
        command
    };
    assert_eq!(shards["spec"]["completionMode"], "Indexed");
    for index in 0..shards["spec"]["completions"].as_u64().unwrap() {
        let mut pod = container(&shards);
        pod.env("JOB_COMPLETION_INDEX", index.to_string());
        if index == 5 {
            let mut killed = pod.spawn().unwrap();
            sleep(MIDWAY);
            killed.kill().unwrap();
            assert!(!killed.wait().unwrap().success());
        }
        success(&mut pod);
    }
    success(&mut container(&merge));
    assert_as_of_one_run(folder, "scene.exr");
}
