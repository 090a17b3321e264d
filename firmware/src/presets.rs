//! The paper's sequence, for tests; users find it as the preset `paper` of the program.

use crate::plan::{Caps, Inputs, Interlock, Plan, Pulse, Start, Stimulus};

/// 70 volumes of 512 images at 60,000 images/s, 225 ms apart; the stimulus comes on with the
/// sixth volume and stays (lines 669-683). In ticks of 16 MHz.
pub(crate) fn paper() -> Plan {
    let second = 16_000_000;
    let sweep = 136_533;
    let interval = 3_600_000;
    Plan {
        inputs: Inputs { interlock: Interlock::On, ready: true, start: Start::Command },
        repeats: 1,
        repeat_period: 0,
        bursts: 70,
        interval,
        sweeps: 1,
        spacing: [0; 2],
        laser: Pulse { delay: 0, width: sweep },
        camera: Pulse { delay: 0, width: 1600 },
        frame: 0,
        phase_limit: None,
        stimulus: Some(Stimulus {
            burst: 5,
            sweep: 0,
            delay: 0,
            on: 64 * interval + u64::from(sweep),
            pulses: 1,
            period: 0,
            sham: false,
        }),
        caps: Caps {
            laser_pulse: 160_000,
            laser_total: u64::from(second),
            stimulus_pulse: u64::from(20 * second),
            stimulus_total: u64::from(20 * second),
            images_per_sweep: 512,
            camera_images: 40_000,
            heartbeat: 2 * second,
        },
    }
}
