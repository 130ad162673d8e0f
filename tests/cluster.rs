//! The engines of `scripts/cluster`, on this machine: 16 shards, one of them killed midway. The merged file has the same bytes as one run.
#![cfg(target_os = "linux")]

mod common;

use std::ffi::OsStr;
use std::fs::{self, File};
use std::net::TcpListener;
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

use common::need::need;
use common::tool::{self, bytes, cornell_with, json, signal, stderr, success, text};
use serde_json::Value;
use tempfile::TempDir;

/// Of what is waited for; a loaded machine may take a minute.
const PATIENCE: Duration = Duration::from_secs(300);
/// Side of the picture.
const SIDE: u32 = 64;
/// Said by a shard that is begun again and finds what it had.
const RESUMED: &str = "going on from ";

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
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

/// Whether all of these programs are installed.
fn installed(engine: &str, programs: &[&str]) -> bool {
    let there = |program: &&str| {
        let look = format!("command -v {program} >/dev/null");
        Command::new("sh").env("PATH", path()).args(["-c", &look]).status().unwrap().success()
    };
    let missing = programs.iter().find(|program| !there(program));
    need(engine, missing.map_or(Ok(()), |program| Err(format!("{program} is not installed")))).is_some()
}

fn wait_for<T>(what: &str, look: impl FnMut() -> Option<T>) -> T {
    tool::wait_for(what, PATIENCE, look)
}

/// The Cornell box in a folder, as `scene.toml`, with settings by which a shard takes a second.
fn folder() -> TempDir {
    let folder = tool::folder();
    let settings = format!("size = [{SIDE}, {SIDE}]\ndirections = 2048\nphotons = 10000\nlayer_size = 64\n");
    cornell_with(folder.path(), "scene.toml", &(settings + "light_samples = 32\n"));
    folder
}

/// Does something to the tool in the midst of a shard of this folder's scene, with a part that it could go on from. The process is as /proc
/// shows it; should it end meanwhile, another one is found.
fn midway<T>(folder: &Path, act: impl Fn(&Path) -> Option<T>) -> T {
    wait_for("a shard that has begun", || {
        let mut processes = fs::read_dir("/proc").unwrap().map(|entry| entry.unwrap().path());
        act(&processes.find(|process| part_of(process).is_some_and(|part| part.starts_with(folder) && has_sums(&part)))?)
    })
}

/// Stops it first, because one that is about to end by itself would end so. Returns once it is gone, so that it is not found again.
fn kill(process: &Path) -> Option<()> {
    let send = |name| signal(name, process.file_name()?.to_str()?).then_some(());
    send("STOP")?;
    let stopped = wait_for("what is to be killed", || {
        let status = fs::read_to_string(process.join("status")).unwrap_or_default();
        let stopped = status.contains("State:\tT");
        (stopped || part_of(process).is_none()).then_some(stopped)
    });
    stopped.then_some(())?;
    send("KILL")?;
    wait_for("the end of what was killed", || part_of(process).is_none().then_some(()));
    Some(())
}

fn words(file: &Path) -> Option<Vec<String>> {
    Some(text(&fs::read(file).ok()?).split('\0').map(str::to_owned).collect())
}

fn variable(process: &Path, name: &str) -> Option<String> {
    words(&process.join("environ"))?.iter().find_map(|word| Some(word.strip_prefix(name)?.strip_prefix('=')?.to_owned()))
}

/// What a process writes if it is the tool at a shard.
fn part_of(process: &Path) -> Option<PathBuf> {
    let arguments = words(&process.join("cmdline")).filter(|arguments| arguments[0].ends_with("finalgather"))?;
    let after = |option| arguments.iter().skip_while(|argument| *argument != option).nth(1);
    let shard = match after("--shard")?.split_once('/') {
        Some((shard, _)) => shard.to_owned(),
        None => variable(process, "SLURM_ARRAY_TASK_ID")?,
    };
    Some(fs::read_link(process.join("cwd")).ok()?.join(after("-o")?.replace("{shard}", &shard)))
}

/// Whether a part holds more than its description.
fn has_sums(part: &Path) -> bool {
    part.metadata().is_ok_and(|file| file.len() > u64::from(SIDE * SIDE * 4))
}

/// That one run writes what was merged.
fn assert_as_of_one_run(folder: &Path, merged: &str) {
    static ONE: OnceLock<Vec<u8>> = OnceLock::new();
    let one = ONE.get_or_init(|| {
        success(command("finalgather", folder).args(["render", "scene.toml", "-o", "one.exr"]));
        bytes(folder, "one.exr")
    });
    assert!(*one == bytes(folder, merged), "{merged} is not what one run writes");
}

/// A cluster of this machine alone. It ends with the value, or else with the thread that made it.
struct Slurm {
    folder: PathBuf,
    daemons: Child,
}

/// What runs must end first, for without its daemons it waits for ever.
const DAEMONS: &str = "
    end() {
        scancel --partition=all
        timeout 40 bash -c 'while [[ $(squeue --noheader) ]]; do sleep 0.1; done'
        kill $(jobs -p)
        wait
    }
    trap end EXIT
    trap exit TERM
    mungekey --create --keyfile=munge.key
    munged --foreground --force --key-file=munge.key --socket=munge.socket --pid-file=munge.pid --log-file=munge.log --seed-file=munge.seed &
    until [[ -S munge.socket ]]; do sleep 0.02; done
    slurmctld -D &
    slurmd -D &
    wait";

impl Slurm {
    fn start(folder: &Path) -> Self {
        let own = folder.join("slurm");
        for name in ["state", "spool"] {
            fs::create_dir_all(own.join(name)).unwrap();
        }
        let ask = |program: &str, arg: &str| text(&success(command(program, folder).arg(arg)).stdout).trim().to_owned();
        let (host, user) = (ask("uname", "-n"), ask("id", "-un"));
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
            own = own.display(),
        );
        fs::write(own.join("slurm.conf"), configuration).unwrap();
        let log = File::create(own.join("log")).unwrap();
        let mut daemons = command("setpriv", &own);
        // Signals of a terminal are not for them.
        daemons.args(["--pdeathsig", "TERM", "bash", "-c", DAEMONS]).env("SLURM_CONF", own.join("slurm.conf")).process_group(0);
        let daemons = daemons.stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap();
        let slurm = Self { folder: own, daemons };
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

    /// Until the queue is empty.
    fn wait(&self) {
        wait_for("the queue to empty", || self.say("squeue --noheader")?.is_empty().then_some(()));
    }
}

impl Drop for Slurm {
    fn drop(&mut self) {
        signal("TERM", self.daemons.id());
        let _ = self.daemons.wait();
    }
}

#[test]
fn slurm() {
    if !installed("Slurm", &["munged", "mungekey", "slurmctld", "slurmd", "sbatch", "srun", "setpriv"]) {
        return;
    }
    let folder = folder();
    let folder = folder.path();
    let slurm = Slurm::start(folder);
    let mut submit = slurm.command(root().join("scripts/cluster/slurm.sh"));
    success(submit.current_dir(folder).args(["merged.exr", "render", "scene.toml", "--checkpoint-every", "0"]));
    midway(folder, kill);
    // One more gives way, as to a job of more weight.
    midway(folder, |process| {
        let (array, task) = (variable(process, "SLURM_ARRAY_JOB_ID")?, variable(process, "SLURM_ARRAY_TASK_ID")?);
        slurm.say(&format!("scontrol requeue {array}_{task}"))
    });
    slurm.wait();

    let logs = (1..=16).map(|shard| fs::read_to_string(folder.join(format!("merged.exr.parts/{shard}.log"))).unwrap());
    let resumed: Vec<_> = logs.filter(|log| log.contains(RESUMED)).collect();
    let killed = resumed.iter().filter(|log| log.contains("ended with 137: requeued"));
    assert_eq!((resumed.len(), killed.count()), (2, 1), "{resumed:#?}");
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
    run.arg("run").arg(root().join("scripts/cluster/openjd.yaml")).args(["--step", "Merge", "--run-dependencies"]);
    for parameter in ["Scene=scene.toml", "Out=merged.exr", "Options=--checkpoint-every 0"] {
        run.args(["--job-param", parameter]);
    }
    let mut first = run.stdout(Stdio::null()).spawn().unwrap();
    wait_for("the third shard", || has_sums(&folder.join("merged.exr.3.part")).then_some(()));
    midway(folder, kill);
    assert!(!first.wait().unwrap().success(), "the job went on without the shard that was killed");
    assert!(!folder.join("merged.exr").exists());

    let second = text(&success(run.stdout(Stdio::piped())).stdout);
    assert!(second.matches("going on from 128 of 128 directions").count() >= 2, "what was complete began anew: {second}");
    assert!(second.matches(RESUMED).count() >= 3, "what was killed began anew: {second}");
    assert_as_of_one_run(folder, "merged.exr");
}

/// There is no cluster here: the manifests are held against Kubernetes' schema, and what their containers would run is run.
#[test]
fn kubernetes() {
    if !installed("Kubernetes manifests", &["kubernetes-validate"]) {
        return;
    }
    let folder = folder();
    let folder = folder.path();
    let [gather, merge] = ["kubernetes.yaml", "kubernetes_merge.yaml"].map(|name| {
        let path = root().join("scripts/cluster").join(name);
        success(command("kubernetes-validate", folder).args(["--strict", "--kubernetes-version", "1.33"]).arg(&path));
        let to_json = "import json, sys, yaml; print(json.dumps(yaml.safe_load(open(sys.argv[1]))))";
        json(command("python", folder).args(["-c", to_json]).arg(path))
    });
    let container = |job: &Value| {
        let container = &job["spec"]["template"]["spec"]["containers"][0];
        let mounted = container["volumeMounts"][0]["mountPath"].as_str().unwrap();
        let words = container["command"].as_array().unwrap().iter().map(|word| word.as_str().unwrap());
        let words: Vec<_> = words.map(|word| word.replace(mounted, folder.to_str().unwrap())).collect();
        let mut container = command(&words[0], folder);
        container.args(&words[1..]);
        container
    };
    assert_eq!(gather["spec"]["completionMode"], "Indexed");
    for index in 0..gather["spec"]["completions"].as_u64().unwrap() {
        let mut pod = container(&gather);
        pod.args(["--checkpoint-every", "0"]).env("JOB_COMPLETION_INDEX", index.to_string());
        if index == 5 {
            let mut first = pod.stderr(Stdio::null()).spawn().unwrap();
            wait_for("the pod's part", || has_sums(&folder.join(format!("scene.{}.part", index + 1))).then_some(()));
            first.kill().unwrap();
            first.wait().unwrap();
        }
        let said = stderr(&success(pod.stderr(Stdio::piped())));
        assert_eq!(said.contains(RESUMED), index == 5, "{said}");
    }
    success(&mut container(&merge));
    assert_as_of_one_run(folder, "scene.exr");
}
