//! The dialogs for files.

use std::path::{Path, PathBuf};

use egui::{Align2, Context, Key, Modifiers, Ui, Vec2};
use egui_file_dialog::{DialogState, FileDialog};
use finalgather::scene::World;

/// What a chosen file is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    OpenScene,
    OpenReference,
    SavePicture,
    SaveScene,
}

pub struct Dialogs {
    dialog: FileDialog,
    purpose: Purpose,
    /// The folder in which dialogs begin.
    folder: Option<PathBuf>,
}

impl Dialogs {
    pub fn new() -> Self {
        Self { dialog: FileDialog::new(), purpose: Purpose::OpenScene, folder: std::env::current_dir().ok() }
    }

    pub fn is_open(&self) -> bool {
        *self.dialog.state() == DialogState::Open
    }

    /// Opens a dialog. `path` is that of the scene, from which a saved file has its name.
    pub fn ask(&mut self, purpose: Purpose, path: &Path) {
        self.purpose = purpose;
        let named = |ending: &str| path.with_extension(ending).file_name().unwrap_or_default().to_string_lossy().into_owned();
        // The middle of the window, above all else in it.
        let mut dialog = FileDialog::new().as_modal(true).default_size([560.0, 360.0]).anchor(Align2::CENTER_CENTER, Vec2::ZERO);
        if let Some(folder) = &self.folder {
            dialog = dialog.initial_directory(folder.clone());
        }
        let filtered =
            |dialog: FileDialog, name: &str, endings| dialog.add_file_filter_extensions(name, endings).default_file_filter(name);
        self.dialog = match purpose {
            Purpose::OpenScene => {
                filtered(dialog.title("Open a scene"), "Scenes", ["toml"].into_iter().chain(World::MODELS).collect())
            }
            Purpose::OpenReference => filtered(dialog.title("Open a reference"), "Pictures", vec!["exr", "png"]),
            Purpose::SavePicture => dialog
                .title("Save the picture")
                .default_file_name(&named("png"))
                .add_save_extension("PNG, 8 bit to look at", "png")
                .add_save_extension("EXR, all channels", "exr"),
            Purpose::SaveScene => {
                let name = named("toml");
                let name = name.strip_suffix(".toml").unwrap_or(&name);
                dialog
                    .title("Save a scene file with this view")
                    .default_file_name(&format!("{name}-view.toml"))
                    .add_save_extension("Scene file", "toml")
            }
        };
        match purpose {
            Purpose::OpenScene | Purpose::OpenReference => self.dialog.pick_file(),
            Purpose::SavePicture | Purpose::SaveScene => self.dialog.save_file(),
        }
    }

    /// Closes the dialog at Escape. Call it before anything else takes the key: the dialog itself ignores it while a text is edited.
    pub fn escape(&mut self, ctx: &Context) {
        if self.is_open() && ctx.input_mut(|input| input.consume_key(Modifiers::NONE, Key::Escape)) {
            self.dialog = FileDialog::new();
        }
    }

    /// Shows the dialog. Returns a chosen or dropped file.
    pub fn show(&mut self, ui: &Ui) -> Option<(Purpose, PathBuf)> {
        self.dialog.update(ui.ctx());
        let picked = self.dialog.take_picked().map(|path| (self.purpose, path));
        let dropped = ui.ctx().input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
        let is_picture = |path: &Path| {
            let ending = path.extension().unwrap_or_default().to_ascii_lowercase();
            ["exr", "png"].iter().any(|picture| ending == *picture)
        };
        let purpose_of = |path: &Path| if is_picture(path) { Purpose::OpenReference } else { Purpose::OpenScene };
        let file = picked.or_else(|| dropped.map(|path| (purpose_of(&path), path)))?;
        self.folder = file.1.parent().map(Path::to_owned);
        Some(file)
    }
}
