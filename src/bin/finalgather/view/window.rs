//! The window: handles events, draws frames, and replaces a lost GL context.

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use egui::ViewportId;
use finalgather::error::{Error, Result};
use finalgather::gpu::Screen;
use finalgather::image::write_srgb8;
use glutin::config::{Config, ConfigTemplateBuilder};
use glutin_winit::{ApiPreference, DisplayBuilder};
use winit::application::ApplicationHandler;
use winit::dpi::{LogicalSize, PhysicalSize};
use winit::event::{StartCause, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow};
use winit::window::{Window as WinitWindow, WindowAttributes, WindowId};

use super::ViewArgs;
use super::app::App;
use super::latency::{Latency, Times};
use super::overlays::NoticeKind;
use super::panel;
use super::probe::PixelValues;

pub struct Window {
    app: App,
    size: [u32; 2],
    scale: Option<f32>,
    glx: bool,
    /// Number of frames to draw after the work is done.
    frames: Option<u32>,
    /// The file for the last of these frames.
    screenshot: Option<PathBuf>,
    shell: Option<Shell>,
    title: String,
    /// When egui asks for the next frame, even without events.
    again: Option<Instant>,
    latency: Latency,
    /// The library that made the last context.
    api: &'static str,
    /// Number of contexts lost in a row.
    losses: u32,
    outcome: Result<()>,
}

/// The system's window with its GL context and egui's state.
struct Shell {
    window: Arc<WinitWindow>,
    config: Config,
    screen: Screen,
    egui: egui_winit::State,
}

/// Results for the report after the window has closed.
pub struct WindowSummary {
    pub outcome: Result<()>,
    /// As [`Latency::first_picture_ms`].
    pub first_picture_ms: Option<f64>,
    /// The times of frames, and of answers to events.
    pub times: [Times; 2],
    /// The library that made the window's context.
    pub api: &'static str,
    pub directions: u32,
    /// The values that were under the cursor last.
    pub cursor: Option<PixelValues>,
    /// Whether the renderer has left its driver.
    pub left: bool,
}

impl Window {
    /// `begun`: when the program was asked for the window.
    pub fn new(args: &ViewArgs, app: App, begun: Instant) -> Self {
        let picture = app.view.settings.film.size;
        let size = args.window.unwrap_or([picture[0].clamp(320, 1280) + panel::WIDTH as u32, picture[1].clamp(640, 900)]);
        Self {
            app,
            size,
            scale: args.scale,
            glx: args.glx,
            frames: args.frames,
            screenshot: args.screenshot.clone(),
            shell: None,
            title: String::new(),
            again: None,
            latency: Latency::new(begun),
            api: "none",
            losses: 0,
            outcome: Ok(()),
        }
    }

    pub fn end(mut self) -> WindowSummary {
        let left = self.app.end();
        let (times, directions) = (self.latency.times(), self.app.directions());
        let first_picture_ms = self.latency.first_picture_ms();
        let (outcome, api, cursor) = (self.outcome, self.api, self.app.canvas.values);
        WindowSummary { outcome, first_picture_ms, times, api, directions, cursor, left }
    }

    fn open(&self, events: &ActiveEventLoop) -> Result<Shell> {
        let failed =
            |problem: String| Error::gl(format!("no window can be made: {problem}"), "try --glx; render works without one");
        let mut size = LogicalSize::<f64>::from(self.size.map(f64::from));
        if let Some(scale) = self.scale {
            size = LogicalSize::new(size.width * f64::from(scale), size.height * f64::from(scale));
        }
        let attributes = WindowAttributes::default().with_title("finalgather").with_inner_size(size);
        let preference = if self.glx { ApiPreference::FallbackEgl } else { ApiPreference::PreferEgl };
        let template = ConfigTemplateBuilder::new().with_depth_size(0).with_stencil_size(0).with_alpha_size(0);
        let first = |mut configs: Box<dyn Iterator<Item = Config> + '_>| configs.next().expect("glutin gives one or fails");
        let (window, config) = DisplayBuilder::new()
            .with_preference(preference)
            .with_window_attributes(Some(attributes))
            .build(events, template, first)
            .map_err(|error| failed(error.to_string()))?;
        let window = Arc::new(window.ok_or_else(|| failed("the window system gave none".into()))?);
        let screen = Screen::new(window.clone(), &config, window.inner_size().into())?;
        let egui = self.egui(events, &screen);
        Ok(Shell { window, config, screen, egui })
    }

    fn egui(&self, events: &ActiveEventLoop, screen: &Screen) -> egui_winit::State {
        egui_winit::State::new(
            egui::Context::default(),
            ViewportId::ROOT,
            events,
            self.scale,
            None,
            Some(screen.max_texture_side()),
        )
    }

    fn redraw(&self) {
        if let Some(shell) = &self.shell {
            shell.window.request_redraw();
        }
    }

    fn fail(&mut self, events: &ActiveEventLoop, error: Error) {
        self.outcome = Err(error);
        events.exit();
    }

    fn frame(&mut self, events: &ActiveEventLoop) -> Result<()> {
        let Some(shell) = &mut self.shell else { return Ok(()) };
        let size: [u32; 2] = shell.window.inner_size().into();
        // An empty window shows nothing. The system asks for a frame when it has a size again.
        if size.contains(&0) {
            return Ok(());
        }
        let begun = Instant::now();
        let input = shell.egui.take_egui_input(&shell.window);
        let context = shell.egui.egui_ctx().clone();
        let mut output = context.run_ui(input, |ui| self.app.show(ui));
        shell.egui.handle_platform_output(&shell.window, output.platform_output);
        let delay = output.viewport_output.get(&ViewportId::ROOT).map(|viewport| viewport.repaint_delay);
        self.again = delay.and_then(|delay| begun.checked_add(delay));
        let primitives = context.tessellate(output.shapes, output.pixels_per_point);
        shell.screen.paint(size, output.pixels_per_point, &primitives, &mut output.textures_delta);

        let last = self.frames.as_mut().filter(|_| self.app.finished()).is_some_and(|frames| {
            *frames = frames.saturating_sub(1);
            *frames == 0
        });
        let shot = self.screenshot.as_ref().filter(|_| last).map(|path| (path, shell.screen.read(size)));
        shell.window.pre_present_notify();
        let presented = shell.screen.present();
        self.latency.frame(begun, self.app.has_picture());
        let title = self.app.title();
        if title != self.title {
            shell.window.set_title(&title);
            self.title = title;
        }
        if let Some((path, image)) = shot {
            let bytes: Vec<u8> = image.pixels.iter().flat_map(|pixel| [pixel.r(), pixel.g(), pixel.b()]).collect();
            write_srgb8(path, image.size, &bytes)?;
        }
        if last || self.app.quit {
            if last && let Some(error) = self.app.failure() {
                self.outcome = Err(error);
            }
            events.exit();
            return Ok(());
        }
        if self.frames.is_some() && self.app.finished() {
            self.again = Some(begun);
        }
        match presented {
            Ok(()) => {
                self.losses = 0;
                Ok(())
            }
            Err(error) => self.recover(events, error),
        }
    }

    /// Makes a new context for the same window. Gives up after the third loss in a row.
    fn recover(&mut self, events: &ActiveEventLoop, error: Error) -> Result<()> {
        self.losses += 1;
        if self.losses == 3 {
            return Err(error);
        }
        let Some(Shell { window, config, screen, .. }) = self.shell.take() else { return Ok(()) };
        drop(screen);
        let screen = Screen::new(window.clone(), &config, window.inner_size().into())?;
        let egui = self.egui(events, &screen);
        self.app.forget_textures();
        self.app.say(format!("{error}\nA new one was made."), NoticeKind::Bad);
        self.shell = Some(Shell { window, config, screen, egui });
        Ok(())
    }
}

impl ApplicationHandler for Window {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        if self.shell.is_none() {
            match self.open(events) {
                Ok(shell) => {
                    self.api = shell.screen.api();
                    self.shell = Some(shell);
                }
                Err(error) => self.fail(events, error),
            }
            self.redraw();
        }
    }

    fn new_events(&mut self, _: &ActiveEventLoop, _: StartCause) {
        self.latency.wakes();
    }

    fn user_event(&mut self, _: &ActiveEventLoop, (): ()) {
        self.app.receive();
        self.redraw();
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(shell) = &mut self.shell else { return };
        match event {
            WindowEvent::CloseRequested => return events.exit(),
            WindowEvent::RedrawRequested => {
                if let Err(error) = self.frame(events) {
                    self.fail(events, error);
                }
                return;
            }
            WindowEvent::Resized(PhysicalSize { width, height }) => shell.screen.resize([width, height]),
            _ => {}
        }
        let human = matches!(
            event,
            WindowEvent::KeyboardInput { .. }
                | WindowEvent::CursorMoved { .. }
                | WindowEvent::MouseInput { .. }
                | WindowEvent::MouseWheel { .. }
                | WindowEvent::PinchGesture { .. }
        );
        if shell.egui.on_window_event(&shell.window, &event).repaint {
            shell.window.request_redraw();
            if human {
                self.latency.event();
            }
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        // The clipboard's thread uses the connection to the window system, which ends with the event loop.
        self.shell = None;
    }

    fn about_to_wait(&mut self, events: &ActiveEventLoop) {
        match self.again {
            Some(again) if again <= Instant::now() => {
                self.again = None;
                self.redraw();
                events.set_control_flow(ControlFlow::Wait);
            }
            Some(again) => events.set_control_flow(ControlFlow::WaitUntil(again)),
            None => events.set_control_flow(ControlFlow::Wait),
        }
        self.latency.sleeps();
    }
}
