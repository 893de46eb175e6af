//! Numbers of the programs that run at the same time.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// The numbers in use, from 0.
#[derive(Debug, Clone, Default)]
pub(super) struct Slots(Arc<Mutex<BTreeSet<usize>>>);

/// A number that no other program of the worker has.
#[derive(Debug)]
pub(super) struct Slot {
    pub(super) number: usize,
    slots: Slots,
}

impl Slots {
    /// The smallest number that is not in use.
    pub(super) fn take(&self) -> Slot {
        let mut used = self.used();
        let number = (0..).find(|number| !used.contains(number));
        // There are fewer programs than numbers.
        let number = number.unwrap_or_default();
        used.insert(number);
        Slot {
            number,
            slots: self.clone(),
        }
    }

    fn used(&self) -> MutexGuard<'_, BTreeSet<usize>> {
        // A panic cannot leave the set half changed.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.slots.used().remove(&self.number);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_number_is_given_again_when_its_program_has_ended() {
        let slots = Slots::default();
        let [first, second, third] = [(); 3].map(|()| slots.take());
        assert_eq!([first.number, second.number, third.number], [0, 1, 2]);
        drop(second);
        assert_eq!(slots.take().number, 1);
        drop((first, third));
        assert_eq!(slots.take().number, 0);
    }
}
