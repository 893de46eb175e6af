//! The batch scripts under `deploy/slurm` on a Slurm cluster of three simulated nodes.

use std::process::Output;
use std::time::{Duration, Instant};

use acceptance::isolated::IsolatedScript;
use acceptance::{Sandbox, assert_code, errors, printed, root, small_campaign};
use serde_json::Value;

use crate::example::{campaign, program};

/// Time limit of every operation of Slurm, which looks at its queue every few seconds.
const PATIENCE: Duration = Duration::from_secs(90);

struct Cluster<'s> {
    sandbox: &'s Sandbox,
    daemons: IsolatedScript,
}

/// Kills all processes of a node with the node's daemon, and tells Slurm, which would otherwise notice after five
/// minutes.
const LOSE_NODE: &str = r#"
for process in /proc/[0-9]*; do
    id=${process#/proc/}
    if { tr '\0' '\n' <$process/environ | grep -qx "SLURMD_NODENAME=$0"; } 2>/dev/null; then
        kill -9 $id $(awk '/^PPid/ { print $2 }' $process/status | grep -vx 1)
    elif { tr '\0' ' ' <$process/cmdline | grep -q "^slurmd -D -N $0 "; } 2>/dev/null; then
        kill -9 $id
    fi
done 2>/dev/null
exec scontrol update nodename=$0 state=down reason=lost
"#;

impl<'s> Cluster<'s> {
    fn start(sandbox: &'s Sandbox) -> Option<Self> {
        let folder = sandbox.path("slurm");
        let text = |path: std::path::PathBuf| path.to_str().expect("UTF-8").to_owned();
        let variables = [
            ("SLURM_CONF", text(folder.join("slurm.conf"))),
            ("PITCHLINE_DIR", text(sandbox.path("home"))),
            ("PITCHLINE_DISK", text(sandbox.path("disk"))),
            ("PITCHLINE_PATIENCE", "60".to_owned()),
            ("PITCHLINE_LOG", "info".to_owned()),
        ];
        let variables = variables.each_ref().map(|(n, value)| (*n, value.as_str()));
        let daemons = IsolatedScript::start("slurm.sh", &folder, &variables)?;
        Some(Self { sandbox, daemons })
    }

    fn try_run(&self, command: &[&str]) -> Output {
        self.daemons.run(self.sandbox, command)
    }

    fn run(&self, command: &[&str]) -> String {
        let output = self.try_run(command);
        assert!(output.status.success(), "{command:?}: {}", errors(&output));
        printed(&output)
    }

    /// Submits a script of `deploy/slurm`; returns the job's number.
    fn submit(&self, options: &[&str], script: &str, arguments: &[&str]) -> String {
        let script = root().join("deploy/slurm").join(script);
        let script = [script.to_str().expect("UTF-8")];
        let command = [&["sbatch", "--parsable"], options, &script, arguments].concat();
        self.run(&command).trim().to_owned()
    }

    /// Submits a coordinator of `campaign`.
    fn coordinator(&self, campaign: &str) -> String {
        // Short leases, so that the jobs of a lost node go to others soon.
        let options = ["--lease", "5", "--listen", "127.0.0.1:0"];
        self.submit(
            &[],
            "coordinator.sbatch",
            &[&[campaign], &options[..]].concat(),
        )
    }

    /// Submits an array of workers that starts after the job `coordinator`.
    fn workers(&self, coordinator: &str, options: &[&str], arguments: &[&str]) -> String {
        let after = format!("--dependency=after:{coordinator}");
        // KillWait is 10 s on this cluster.
        let grace = ["--grace", "6"];
        self.submit(
            &[&[after.as_str(), "--cpus-per-task=2"], options].concat(),
            "workers.sbatch",
            &[&grace, arguments].concat(),
        )
    }

    /// A field of a job in Slurm, such as `JobState`.
    fn field(&self, job: &str, name: &str) -> String {
        let job = self.run(&["scontrol", "show", "job", "--oneliner", job]);
        let fields = job.split_whitespace().filter_map(|f| f.split_once('='));
        let mut values = fields.filter(|(n, _)| *n == name).map(|(_, value)| value);
        values.next().expect("the job has the field").to_owned()
    }

    fn wait_until(&self, what: &str, is_so: impl Fn() -> bool) {
        let since = Instant::now();
        while !is_so() {
            let jobs = || self.run(&["scontrol", "show", "job", "--oneliner"]) + &self.logs();
            assert!(since.elapsed() < PATIENCE, "no {what}: {}", jobs());
            std::thread::sleep(Duration::from_millis(100));
        }
    }

    /// Waits until a job has ended with this state and exit code.
    fn assert_end(&self, job: &str, end: &str) {
        let field = |name| self.field(job, name);
        self.wait_until(&format!("job {job} that ended with {end}"), || {
            format!("{} {}", field("JobState"), field("ExitCode")) == end
        });
    }

    fn wait_until_requeued(&self, job: &str) {
        self.wait_until(&format!("restart of {job}"), || {
            self.field(job, "Restarts") == "1"
        });
    }

    /// The output of the jobs.
    fn logs(&self) -> String {
        let all = std::fs::read_dir(self.sandbox.path(".")).expect("a folder");
        let logs = all
            .filter_map(|entry| Some(entry.ok()?.path()))
            .filter(|path| path.extension().is_some_and(|ending| ending == "log"));
        logs.map(|path| {
            let text = std::fs::read_to_string(&path).expect("a log");
            format!("{}:\n{text}", path.display())
        })
        .collect()
    }

    /// The status, from the coordinator itself, as a user asks for it.
    fn status(&self) -> Option<Value> {
        let access = self.sandbox.path("home/campaign.access");
        let access = access.to_str().expect("UTF-8");
        let output = self.try_run(&["coordinator", "status", "--access", access, "--json"]);
        serde_json::from_slice(&output.stdout).ok()
    }

    fn wait_for_samples(&self, more_than: u64) {
        self.wait_until(&format!("more than {more_than} samples"), || {
            let done = |status: Value| status["samples"]["done"].as_u64();
            self.status().and_then(done) > Some(more_than)
        });
    }
}

/// Asserts that both stores hold the same finished campaign, of which no job failed.
fn assert_equal(sandbox: &Sandbox, stored: &str, local: &str) {
    let (stored, local) = (
        sandbox.status(stored).unwrap(),
        sandbox.status(local).unwrap(),
    );
    assert_eq!(stored["finished"], true, "{stored}");
    assert_eq!(stored["samples_digest"], local["samples_digest"]);
    assert_eq!(
        stored["point_samples_digest"],
        local["point_samples_digest"]
    );
}

#[test]
fn slurm_array_with_a_lost_node_gives_the_samples_of_a_local_run() {
    let sandbox = Sandbox::new();
    let Some(cluster) = Cluster::start(&sandbox) else {
        return;
    };
    let file = sandbox.write("c.toml", &small_campaign(300, 4000));
    let file = file.to_str().unwrap();
    // Somebody may have used the folder before.
    std::fs::create_dir(sandbox.path("home")).unwrap();
    sandbox.write("home/finished", "");
    let coordinator = cluster.coordinator(file);
    let workers = cluster.workers(&coordinator, &["--array=1-4"], &[]);
    cluster.wait_for_samples(10_000);
    // Tasks fill one node after the other; the coordinator is on the first.
    let elements = [1, 2, 3, 4].map(|task| format!("{workers}_{task}"));
    let on_n3 = |job: &&String| cluster.field(job, "NodeList") == "n3";
    let lost: Vec<_> = elements.iter().filter(on_n3).collect();
    assert!(!lost.is_empty(), "{}", cluster.run(&["squeue"]));
    cluster.run(&["bash", "-c", LOSE_NODE, "n3"]);
    for element in lost {
        cluster.wait_until_requeued(element);
    }
    cluster.assert_end(&coordinator, "COMPLETED 0:0");
    let since = Instant::now();
    for element in &elements {
        cluster.assert_end(element, "COMPLETED 0:0");
    }
    assert!(since.elapsed() < Duration::from_secs(60));
    let logs = cluster.logs();
    let registered: Vec<_> = logs
        .lines()
        .filter(|line| line.contains("worker registered"))
        .collect();
    assert!(registered.len() >= 4, "{logs}");
    assert!(
        registered.iter().all(|line| line.contains("slots=2")),
        "{logs}"
    );
    assert_code(&sandbox.coordinator(&["run", file, "--db", "local.db"]), 0);
    assert_equal(&sandbox, "disk/n1/campaign.db", "local.db");
    assert!(sandbox.path("home/report/report.html").exists());

    // A worker that is late sees that the campaign is finished; without one, it waits, but not silently.
    let late = cluster.workers(&coordinator, &["--array=1"], &[]);
    cluster.assert_end(&late, "COMPLETED 0:0");
    std::fs::remove_file(sandbox.path("home/finished")).unwrap();
    let alone = ["--array=1", "--export=ALL,PITCHLINE_PATIENCE=12"];
    let alone = cluster.workers(&coordinator, &alone, &[]);
    cluster.assert_end(&alone, "FAILED 11:0");
    let logs = cluster.logs();
    for said in ["the campaign is finished", "waiting for a coordinator"] {
        assert!(logs.contains(said), "{said}: {logs}");
    }
}

/// The example's campaign and its program, of which a sample takes 0.3 s while a file "slow" is there.
fn slow_example(sandbox: &Sandbox) -> (String, String) {
    let changes = [
        ("probe_designs = 3 ", "probe_designs = 0 "),
        ("evaluations = 300 ", "evaluations = 40 "),
        ("restart_at = 150", "restart_at = 20"),
        ("starts = 2", "starts = 1"),
        ("samples = 100", "samples = 20"),
    ];
    let from = "        generator = random";
    let flag = sandbox.write("slow", "");
    let slow = format!(
        "        __import__(\"time\").sleep(0.3 * __import__(\"os\").path.exists({flag:?}))\n{from}"
    );
    (
        campaign(sandbox, &changes),
        program(sandbox, "slow.py", &[(from, &slow)]),
    )
}

#[test]
fn whatever_slurm_ends_finished_samples_stay_and_no_failure_counts() {
    let sandbox = Sandbox::new();
    let Some(cluster) = Cluster::start(&sandbox) else {
        return;
    };
    let (file, exec) = slow_example(&sandbox);
    // Slurm's SIGTERM goes to all processes of a job: one simulator survives it, the other does not.
    let survivor = format!("trap '' TERM; {exec}");
    let coordinator = cluster.coordinator(&file);
    let patient = cluster.workers(&coordinator, &["--array=1-2"], &["--exec", &survivor]);
    let plain = cluster.workers(&coordinator, &["--array=1-2"], &["--exec", &exec]);
    // The time is up in a minute, and the signal comes when Slurm next looks.
    let brief = ["--array=1", "--time=1", "--signal=B:USR1@59"];
    let brief = cluster.workers(&coordinator, &brief, &["--exec", &exec]);
    cluster.wait_for_samples(60);
    let failures = |when: &str| {
        let status = sandbox.status("disk/n1/campaign.db").unwrap();
        assert_eq!(status["failures"], 0, "{when}: {status}");
    };

    // Cancelled, and asked to leave.
    cluster.run(&["scancel", &format!("{patient}_1")]);
    cluster.run(&["scancel", &format!("{plain}_1")]);
    cluster.assert_end(&format!("{patient}_1"), "CANCELLED 14:0");
    cluster.assert_end(&format!("{plain}_1"), "CANCELLED 14:0");
    failures("cancelled");
    let asked = format!("{plain}_2");
    cluster.run(&["scancel", "--full", "--signal=TERM", &asked]);
    cluster.assert_end(&asked, "FAILED 14:0");
    failures("asked to leave");
    // The time is up.
    cluster.wait_until_requeued(&format!("{brief}_1"));
    failures("overdue");
    // Preempted.
    let preempted = format!("{patient}_2");
    let node = cluster.field(&preempted, "NodeList");
    let urgent = ["--partition=urgent", "--cpus-per-task=4", "--wrap=sleep 1"];
    let urgent = cluster.run(
        &[
            &["sbatch", "--parsable", "--nodelist", &node],
            &urgent[..],
            &["--output=/dev/null"],
        ]
        .concat(),
    );
    cluster.wait_until_requeued(&preempted);
    cluster.assert_end(urgent.trim(), "COMPLETED 0:0");
    failures("preempted");
    // The coordinator's node is needed otherwise, so the coordinator continues on another node.
    let before = sandbox.status("disk/n1/campaign.db").unwrap();
    assert_eq!(before["finished"], false, "the campaign was too short");
    cluster.run(&[
        "scontrol",
        "update",
        "nodename=n1",
        "state=drain",
        "reason=repair",
    ]);
    cluster.run(&["scontrol", "requeue", &coordinator]);
    std::fs::remove_file(sandbox.path("slow")).unwrap();
    cluster.assert_end(&coordinator, "COMPLETED 0:0");
    let node = cluster.field(&coordinator, "NodeList");
    assert_ne!(node, "n1");
    for worker in [&preempted, &format!("{brief}_1")] {
        cluster.assert_end(worker, "COMPLETED 0:0");
    }
    let local = ["run", &file, "--db", "local.db", "--exec", &exec];
    assert_code(&sandbox.coordinator(&local), 0);
    let store = format!("disk/{node}/campaign.db");
    assert_equal(&sandbox, &store, "local.db");
    let after = sandbox.status(&store).unwrap();
    assert_eq!(after["failures"], 0, "{after}");
}
