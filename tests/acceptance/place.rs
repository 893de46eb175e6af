//! A coordinator on loopback and the workers that connect to it.

use std::process::Output;

use acceptance::{RunningProgram, Sandbox, assert_code, free_address, printed, small_campaign};

/// The store of the coordinators in a test.
pub(crate) const DB: &str = "c.db";

/// Options for leases of five seconds: some tests wait until a lease expires.
const SHORT_LEASES: [&str; 2] = ["--lease", "5"];

/// The fixed campaign, store and address of successive coordinators.
pub(crate) struct Place<'s> {
    sandbox: &'s Sandbox,
    pub(crate) file: String,
    pub(crate) address: String,
}

impl<'s> Place<'s> {
    pub(crate) fn new(sandbox: &'s Sandbox, campaign: &str) -> Self {
        let file = sandbox.write("c.toml", campaign).display().to_string();
        Self::of_file(sandbox, &file)
    }

    /// Uses the campaign in an existing file.
    pub(crate) fn of_file(sandbox: &'s Sandbox, file: &str) -> Self {
        Self {
            sandbox,
            file: file.to_owned(),
            address: free_address().to_string(),
        }
    }

    /// Uses a campaign that samples for some seconds on two cores.
    pub(crate) fn long(sandbox: &'s Sandbox) -> Self {
        Self::new(sandbox, &small_campaign(300, 4000))
    }

    pub(crate) fn serve(&self, options: &[&str]) -> RunningProgram {
        self.start(&[&SHORT_LEASES[..], options].concat())
    }

    /// Starts a coordinator with leases of this many seconds.
    pub(crate) fn serve_for(&self, lease: &str) -> RunningProgram {
        self.start(&["--lease", lease])
    }

    /// Starts a coordinator that crashes at a fail point.
    pub(crate) fn serve_dying(&self, point: &str) -> RunningProgram {
        let arguments = [&self.command()[..], &SHORT_LEASES].concat();
        self.sandbox.start_dying(point, &arguments)
    }

    fn start(&self, options: &[&str]) -> RunningProgram {
        let arguments = [&self.command()[..], options].concat();
        self.sandbox.start("coordinator", &arguments)
    }

    fn command(&self) -> [&str; 6] {
        ["serve", &self.file, "--db", DB, "--listen", &self.address]
    }

    pub(crate) fn worker(&self, options: &[&str]) -> RunningProgram {
        let connect = ["--connect", &self.address];
        self.sandbox.start("worker", &[&connect, options].concat())
    }

    /// Runs a worker until it ends by itself.
    pub(crate) fn work(&self, options: &[&str]) -> Output {
        let connect = ["--connect", &self.address];
        self.sandbox.run("worker", &[&connect, options].concat())
    }

    pub(crate) fn wait_for_some_samples(&self) {
        let some = |status: &serde_json::Value| status["samples"]["done"].as_u64() > Some(10_000);
        self.sandbox.wait_for(DB, "some samples", some);
    }

    /// Runs a command that queries or steers the coordinator, and returns its output.
    pub(crate) fn ask(&self, arguments: &[&str]) -> String {
        let output = self
            .sandbox
            .coordinator(&[arguments, &["--connect", &self.address]].concat());
        assert_code(&output, 0);
        printed(&output)
    }
}
