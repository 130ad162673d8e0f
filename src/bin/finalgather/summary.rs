//! The line at the end of a job: what was made, how well, and where the time went.

use finalgather::job::{JobReport, TaskReport};
use finalgather::settings::Exposure;

use crate::report;

/// Less is not told.
const LEAST_SECONDS: f64 = 0.05;

/// For example `box.png: 512x512, 214355 points, 1000 directions, error 1.1 %, 12.3 s (photons 1.0, gather 7.9), 2 warnings`.
pub fn line(job: &JobReport) -> String {
    let mut facts = match &job.task {
        TaskReport::Render { gather, error, exposure, .. } => {
            let [width, height] = job.settings.film.size;
            let mut facts = vec![format!("{width}x{height}"), counted(gather.points as usize, "point")];
            facts.push(counted(gather.directions as usize, "direction"));
            let automatic = exposure.filter(|_| job.settings.display.exposure == Exposure::Auto);
            facts.extend(automatic.map(|stops| format!("exposure {stops:+.2}")));
            facts.extend(error.map(|error| format!("error {:.2} %", 100.0 * error)));
            facts
        }
        TaskReport::Bake { receivers, .. } => {
            let mut facts: Vec<_> =
                receivers.iter().map(|receiver| format!("{} of {}", counted(receiver.points, "point"), receiver.to)).collect();
            facts.push(counted(job.settings.directions.count as usize, "direction"));
            facts
        }
    };
    facts.push(times(job));
    if let warnings @ 1.. = report::warnings() {
        facts.push(counted(warnings, "warning"));
    }
    format!("{}: {}", job.head.outputs.join(", "), facts.join(", "))
}

fn times(job: &JobReport) -> String {
    let seconds = &job.seconds;
    let stages = seconds.stages.as_object().into_iter().flatten();
    let stages = stages.filter_map(|(name, value)| Some((name.replace('_', " "), value.as_f64()?)));
    let of_bake = match &job.task {
        TaskReport::Bake { bake, .. } => {
            vec![("photons", bake.seconds.photons), ("direct", bake.seconds.direct), ("gather", bake.seconds.gather)]
        }
        TaskReport::Render { .. } => Vec::new(),
    };
    let named = |(name, value): (&str, f64)| (name.to_owned(), value);
    let all = [named(("load", seconds.load))].into_iter().chain(stages);
    let all = all.chain(of_bake.into_iter().map(named)).chain([named(("write", seconds.write))]);
    let told: Vec<_> =
        all.filter(|(_, value)| *value >= LEAST_SECONDS).map(|(name, value)| format!("{name} {value:.1}")).collect();
    let of = if told.is_empty() { String::new() } else { format!(" ({})", told.join(", ")) };
    format!("{:.1} s{of}", seconds.total)
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}
