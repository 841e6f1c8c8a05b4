//! The terminal while it shows the live view, and as it was before afterwards: also after a panic.

use std::io::{self, IsTerminal, Stdout, Write};
use std::mem::ManuallyDrop;
use std::panic;

use crossterm::cursor::{Hide, Show};
use crossterm::execute;
use crossterm::terminal::{
    Clear, ClearType, EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use ratatui::Terminal;
use ratatui::backend::CrosstermBackend;
use ratatui::text::Line;
use ratatui::widgets::Paragraph;

use crate::failure::Failure;
use crate::output::Output;
use crate::terminal;

/// Refuses where there is nothing to draw on, and says what does without.
pub fn refuse_without_terminal(out: Output) -> Result<(), Failure> {
    let instead = "`mgw watch` prints samples and events, `mgw state` how the axes are now; both \
        have --json";
    let wrong = if out.is_json() {
        "top draws on a terminal and has no JSON"
    } else if !io::stdout().is_terminal() {
        "top draws on a terminal, and standard output is none"
    } else if !io::stdin().is_terminal() {
        "top follows the keys of a terminal, and standard input is none"
    } else if terminal::is_dumb() {
        "top places text on a terminal, and TERM=dumb cannot"
    } else {
        return Ok(());
    };
    Err(Failure::Usage(format!("{wrong}; {instead}")))
}

/// The terminal; as it was before when this is dropped.
pub struct Display {
    /// Never dropped by itself: it would show the cursor, which [`restore`] does, and panic where
    /// it can tell nobody that the terminal has gone.
    terminal: ManuallyDrop<Terminal<CrosstermBackend<Stdout>>>,
}

impl Display {
    /// Takes the terminal over.
    pub fn open() -> Result<Self, Failure> {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            restore();
            before(info);
        }));
        enable_raw_mode().map_err(Failure::Terminal)?;
        let opened = execute!(io::stdout(), EnterAlternateScreen, Hide)
            .and_then(|()| Terminal::new(CrosstermBackend::new(io::stdout())));
        match opened {
            Ok(terminal) => Ok(Self { terminal: ManuallyDrop::new(terminal) }),
            Err(error) => {
                restore();
                Err(Failure::Terminal(error))
            }
        }
    }

    /// Shows the lines that are made for its size.
    pub fn show(
        &mut self,
        lines: impl FnOnce(u16, u16) -> Vec<Line<'static>>,
    ) -> Result<(), Failure> {
        let drawn = self.terminal.draw(|frame| {
            let area = frame.area();
            frame.render_widget(Paragraph::new(lines(area.width, area.height)), area);
        });
        drawn.map(drop).map_err(Failure::Terminal)
    }

    /// Takes the terminal over again: whoever ran in between has left it otherwise, so that no key
    /// came.
    pub fn take_again(&mut self) -> Result<(), Failure> {
        // crossterm takes what it has set for what is.
        let _ = disable_raw_mode();
        enable_raw_mode().map_err(Failure::Terminal)?;
        // A new one, which knows nothing of what is on the screen. Its own way asks the terminal
        // where the cursor is, and waits.
        let terminal = execute!(io::stdout(), EnterAlternateScreen, Hide, Clear(ClearType::All))
            .and_then(|()| Terminal::new(CrosstermBackend::new(io::stdout())))
            .map_err(Failure::Terminal)?;
        self.terminal = ManuallyDrop::new(terminal);
        Ok(())
    }

    /// Leaves the terminal to others, until [`Self::take_again`].
    pub fn give_back(&self) {
        restore();
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        restore();
    }
}

/// With nobody to see it there is nothing more to do.
fn restore() {
    let _ = disable_raw_mode();
    let _ = execute!(io::stdout(), LeaveAlternateScreen, Show);
    let _ = io::stdout().flush();
}
