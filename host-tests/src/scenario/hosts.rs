//! Hosts that behave badly, and more than one of them.

use super::bench::{Bench, SETPOINT_TTL};
use super::words::{duration, parse, setpoint};
use host_protocol::{Call, Kind, MAX_FRAME, Setpoint, encode, requests};
use std::time::Duration;

/// How often a host that hangs goes on making setpoints.
const BACKLOG_PERIOD: Duration = Duration::from_millis(20);

impl Bench {
    /// `as LINK STEP`: the step is that of the host on another link.
    pub fn as_other(&mut self, words: &[&str]) -> Result<(), String> {
        let link: u8 = parse(words, 0, "link")?;
        if link == self.link {
            return Err("that is the host on link 0 itself".to_string());
        }
        self.collect();
        let mut other = self.take_other(link)?;
        std::mem::swap(&mut self.client, &mut other);
        let first = std::mem::replace(&mut self.link, link);
        let result = self.step(words.get(1..).unwrap_or_default());
        self.link = first;
        std::mem::swap(&mut self.client, &mut other);
        self.others.push((link, other));
        result
    }

    /// `bytes XX …`: bytes on the host link as they are.
    pub fn bytes(&mut self, words: &[&str]) -> Result<(), String> {
        let bytes: Result<Vec<u8>, _> =
            words.iter().map(|byte| u8::from_str_radix(byte, 16)).collect();
        self.world.borrow_mut().host_send(self.link, &bytes.map_err(|e| e.to_string())?);
        Ok(())
    }

    /// `flood noise N`: N random bytes. `flood pings N`, `flood setpoints N AXIS KIND VALUE`: N
    /// requests. All at once, as fast as the link carries them.
    pub fn flood(&mut self, words: &[&str]) -> Result<(), String> {
        let count: usize = parse(words, 1, "count")?;
        let mut bytes = Vec::new();
        match words.first() {
            Some(&"noise") => bytes.extend((0..count).map(|_| self.random.u8(..))),
            Some(&"pings") => (0..count).for_each(|_| bytes.extend(self.frame(&requests::Ping {}))),
            Some(&"setpoints") => {
                let (axis, value) = (parse(words, 2, "axis")?, setpoint(words, 3)?);
                for _ in 0..count {
                    let request = self.setpoint_until(axis, value, SETPOINT_TTL);
                    bytes.extend(self.frame(&request));
                }
            }
            other => return Err(format!("{other:?} is no flood")),
        }
        self.world.borrow_mut().host_send(self.link, &bytes);
        Ok(())
    }

    /// `backlog TIME AXIS KIND VALUE`: so long the host makes setpoints and gets none of them onto
    /// its link.
    pub fn grow_backlog(&mut self, words: &[&str]) -> Result<(), String> {
        let time = duration(words, 0)?;
        let (axis, value): (u8, Setpoint) = (parse(words, 2, "axis")?, setpoint(words, 3)?);
        let end = self.client.now() + time;
        while self.client.now() < end {
            let request = self.setpoint_until(axis, value, SETPOINT_TTL);
            let frame = self.frame(&request);
            self.backlog.extend(frame);
            self.silence(BACKLOG_PERIOD);
        }
        Ok(())
    }

    /// `release-backlog`: all of it goes onto the link at once.
    pub fn release_backlog(&mut self) -> Result<(), String> {
        let bytes = std::mem::take(&mut self.backlog);
        if bytes.is_empty() {
            return Err("there is no backlog".to_string());
        }
        self.world.borrow_mut().host_send(self.link, &bytes);
        Ok(())
    }

    /// `host-reads on|off`: whether the host takes what the gateway sends on its link.
    pub fn host_reads(&mut self, words: &[&str]) -> Result<(), String> {
        let reads = match words.first() {
            Some(&"on") => true,
            Some(&"off") => false,
            other => return Err(format!("a host reads, on or off, not {other:?}")),
        };
        self.world.borrow_mut().set_host_reads(self.link, reads);
        Ok(())
    }

    /// A setpoint that expires `ttl` from now, as the gateway counts time.
    pub fn setpoint_until(
        &self,
        axis: u8,
        setpoint: Setpoint,
        ttl: Duration,
    ) -> requests::Setpoint {
        let expires_at_us = self.gateway_time(ttl);
        requests::Setpoint { axis, epoch: self.epoch(axis), expires_at_us, setpoint }
    }

    /// The low 32 bits of the gateway's time in a while.
    pub fn gateway_time(&self, ahead: Duration) -> u32 {
        let ahead =
            gateway::Duration::from_micros(u64::try_from(ahead.as_micros()).unwrap_or(u64::MAX));
        (self.world.borrow().gateway_now() + ahead).low_bits()
    }

    /// A request with a sequence number that the client will not use soon.
    fn frame<C: Call>(&mut self, request: &C) -> Vec<u8> {
        let mut frame = [0; MAX_FRAME];
        let length = encode(Kind::Request, self.random.u16(..), C::NUMBER, request, &mut frame);
        frame.get(..length.unwrap_or(0)).unwrap_or_default().to_vec()
    }
}
