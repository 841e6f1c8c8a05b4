//! What a scenario demands of the gateway as a whole: its pins and its memory.

use super::bench::Bench;
use super::words::parse;

impl Bench {
    /// `enable-output on|off`, `boot REASON`, `crash-report TEXT`, `incidents N`, `incident PLACE
    /// TEXT`
    pub fn expect_of_gateway(&mut self, what: &str, words: &[&str]) -> Result<(), String> {
        match what {
            "enable-output" => self.expect_enable_output(words),
            "boot" => self.expect_text(&format!("{:?}", self.client.hello().boot), words),
            "crash-report" => {
                let text = self.client.crash_report().map_err(|e| e.to_string())?;
                self.expect_text(&text, words)
            }
            _ => self.expect_incidents(what, words),
        }
    }

    /// The pin itself, and what the gateway says of it.
    fn expect_enable_output(&mut self, words: &[&str]) -> Result<(), String> {
        let wanted = match words.first() {
            Some(&"on") => true,
            Some(&"off") => false,
            other => return Err(format!("the output is on or off, not {other:?}")),
        };
        let pin = self.world.borrow().enable_output();
        let told = self.client.gateway_status().map_err(|e| e.to_string())?.enable_output;
        if pin == wanted && told == Some(wanted) {
            return Ok(());
        }
        Err(format!("the pin is {pin}, the gateway says {told:?}"))
    }

    /// `incidents N`: so many are remembered. `incident PLACE TEXT`: the one at this place, from
    /// the latest at 0, contains this.
    fn expect_incidents(&mut self, what: &str, words: &[&str]) -> Result<(), String> {
        let incidents = self.client.incidents().map_err(|e| e.to_string())?;
        let number: usize = parse(words, 0, "number")?;
        let wanted = words.get(1..).unwrap_or_default().join(" ");
        let fits = match what {
            "incidents" => incidents.len() == number,
            _ => incidents
                .get(number)
                .is_some_and(|incident| format!("{incident:?}").contains(&wanted)),
        };
        if fits {
            Ok(())
        } else {
            Err(format!("{} are remembered: {incidents:?}", incidents.len()))
        }
    }

    fn expect_text(&self, seen: &str, words: &[&str]) -> Result<(), String> {
        if seen == words.join(" ") { Ok(()) } else { Err(format!("it is {seen:?}")) }
    }
}
