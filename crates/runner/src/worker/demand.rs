//! How much work a worker asks for.

/// Seconds of work to hold per slot, including the job that is being computed: enough to make the
/// time of round trips negligible. Long jobs are not prefetched: another worker may have a free
/// slot.
const HELD_SECONDS: f64 = 2.0;

/// The worker asks for more leases when less than this share of the work is left.
const LOW: f64 = 0.75;

/// Maximum number of leases per slot.
const HELD_LEASES: usize = 2000;

/// The amount of work to ask for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LeaseDemand {
    /// Maximum number of leases.
    pub leases: usize,
    /// Expected time of the leases, in seconds, after which no more are needed.
    pub seconds: f64,
}

impl LeaseDemand {
    /// The demand of a worker with `slots` slots that holds leases with these expected times in seconds;
    /// none while it has enough.
    pub fn of(slots: usize, held: impl Iterator<Item = f64>) -> Option<Self> {
        let (count, worth) =
            held.fold((0, 0.0), |(count, worth), lease| (count + 1, worth + lease));
        let (leases, seconds) = (HELD_LEASES * slots, HELD_SECONDS * slots as f64);
        let is_low = worth < LOW * seconds && (count as f64) < LOW * leases as f64;
        (count < slots || is_low).then(|| Self {
            leases: leases - count,
            seconds: seconds - worth,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shorter_the_leases_the_more_are_held_ahead() {
        let held = |leases, seconds| LeaseDemand::of(2, std::iter::repeat_n(seconds, leases));
        let wanted = |leases, seconds| Some(LeaseDemand { leases, seconds });
        assert_eq!(held(0, 0.0), wanted(4000, 4.0));
        assert_eq!(held(2, 1.0), wanted(3998, 2.0));
        assert_eq!(held(4, 1.0), None);
        assert_eq!(held(1, 3600.0), wanted(3999, -3596.0), "a slot is free");
        assert_eq!(held(2, 3600.0), None, "somebody else may have a slot free");
        let many = held(2500, 1e-6).unwrap();
        assert_eq!(many.leases, 1500);
        assert!((many.seconds - (4.0 - 0.0025)).abs() < 1e-9);
        assert_eq!(held(3500, 1e-6), None, "they are asked for by the handful");
    }
}
