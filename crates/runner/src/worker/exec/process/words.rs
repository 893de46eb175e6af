//! The part of an error that describes the end of a process.

use std::time::{Duration, Instant};

use super::super::ending::{self, AFTER_INPUT};
use super::super::output::{Line, malformed, quote};
use super::{FLUSH, Process, WHOLE_PIPE};

/// Time for a process that closed its output to end by itself.
const LAST_WORDS: Duration = Duration::from_millis(500);

impl Process {
    /// Ends the process, whose `answer` cannot be used, and returns the error.
    pub(in super::super) fn refute(&mut self, answer: &str, reason: &str, line: &str) -> String {
        self.obituary(&malformed(answer.as_bytes(), reason), line)
    }

    /// Describes the end of a process that closed its output.
    pub(super) fn last_words(&mut self) -> String {
        let since = Instant::now();
        while !ending::has_ended(self.group) {
            if since.elapsed() > LAST_WORDS {
                return "closed its standard output and was ended".to_owned();
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        match self.end() {
            Ok(status) => {
                let unfinished = match self.pending.trim_ascii() {
                    [] => String::new(),
                    rest => format!(" in the middle of the line {}", quote(rest)),
                };
                let advice = if status.success() && self.has_answered {
                    "; a program must answer one request after the other until its input ends"
                } else {
                    ""
                };
                format!("ended ({status}) before it had answered{unfinished}{advice}")
            }
            Err(error) => format!("ended before it had answered ({error})"),
        }
    }

    /// Closes the input of a process that has not answered, and describes its last output: a
    /// program that does not flush its output does so at its end.
    pub(super) fn late_words<T>(
        &mut self,
        timeout: Duration,
        read: &dyn Fn(&[u8]) -> Line<T>,
    ) -> String {
        let seconds = timeout.as_secs_f64();
        self.input = None;
        let since = Instant::now();
        let mut has_more = true;
        while has_more && since.elapsed() < AFTER_INPUT {
            has_more = match self.wait(false, Duration::from_millis(20)) {
                Ok([true, _]) => self.read_lines().is_ok(),
                Ok(_) => true,
                Err(_) => false,
            };
            self.drain_errors();
        }
        if matches!(self.answer(read, true), Ok(Some(_))) {
            return format!(
                "gave its answer only when its input was closed, after its {seconds} s: it needs a longer time \
                 (simulator.timeout_s or --exec-timeout), or it must {FLUSH}"
            );
        }
        let unfinished = match self.pending.trim_ascii() {
            [] => String::new(),
            rest => format!(" (its last line has no newline: {})", quote(rest)),
        };
        format!(
            "gave no answer within {seconds} s and was ended{unfinished}. If it has answered, it must \
             {FLUSH}"
        )
    }

    /// Ends the group. Returns the reason, the request and the end of the standard error.
    pub(in super::super) fn obituary(&mut self, why: &str, line: &str) -> String {
        // The exit status is part of `why` if it matters.
        let _ = self.end();
        // All output is in the pipe now.
        for _ in 0..WHOLE_PIPE {
            self.drain_errors();
        }
        let asked = quote(line.trim_end().as_bytes());
        let mut text = format!("the simulator {why}\nasked: {asked}");
        if self.tail.bytes.is_empty() {
            text += "\nits standard error was empty";
        } else {
            text += "\nthe end of its standard error:\n";
            text += self.tail.text().trim_end();
        }
        text
    }
}
