//! The energy that the swarm has used at the moments the summary reports.

use crate::summary::Energy;
use skein_protocol::record::DroneRow;

/// Energies at the first detection and when the last obstacle set was passed.
#[derive(Default)]
pub(crate) struct EnergyMarks {
    /// Of each drone, J.
    at_detection: Option<Vec<f64>>,
    until_passed: Option<f64>,
    detection_to_pass: Option<f64>,
}

impl EnergyMarks {
    /// Notes the energies at the first detection. `rows` are those of the tick before it, empty in the first tick of a
    /// mission.
    pub(crate) fn detected(&mut self, rows: &[DroneRow], drones: u32) {
        let before = if rows.is_empty() { vec![0.0; drones as usize] } else { energies(rows) };
        self.at_detection = Some(before);
    }

    /// Notes the energies when the last obstacle set was passed.
    pub(crate) fn passed(&mut self, rows: &[DroneRow]) {
        self.until_passed = Some(sum_of_living(rows, energies(rows)));
        self.detection_to_pass = self.at_detection.as_ref().map(|before| {
            let since = rows.iter().zip(before).map(|(row, before)| row.energy_j - before);
            sum_of_living(rows, since.collect())
        });
    }

    /// The energies of the summary, with the rows of the last tick. `stages` tells whether the mission has obstacles.
    pub(crate) fn finish(self, rows: &[DroneRow], stages: bool) -> Energy {
        Energy {
            total: sum_of_living(rows, energies(rows)),
            until_passed: self.until_passed.filter(|_| stages),
            detection_to_pass: self.detection_to_pass.filter(|_| stages),
            per_drone: energies(rows),
        }
    }
}

fn energies(rows: &[DroneRow]) -> Vec<f64> {
    rows.iter().map(|row| row.energy_j).collect()
}

/// The sum over living drones. `Iterator::sum` would give −0 without a living drone.
fn sum_of_living(rows: &[DroneRow], values: Vec<f64>) -> f64 {
    rows.iter().zip(values).filter(|(row, _)| row.alive()).map(|(_, value)| value).fold(0.0, |sum, value| sum + value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_swarm_without_a_living_drone_has_used_nothing() {
        let dead = DroneRow { energy_j: 5.0, ..DroneRow::default() };
        let energy = EnergyMarks::default().finish(&[dead], false);
        assert!(energy.total == 0.0 && energy.total.is_sign_positive(), "{}", energy.total);
    }
}
