//! The instructor's page with a trainer that is none: `cargo run --release -p bowwave-instructor --example fake [ADDRESS [JOURNAL]]`.

use std::{
    env,
    error::Error,
    path::PathBuf,
    sync::atomic::{AtomicBool, Ordering},
};

use bowwave_instructor::{Instructor, InstructorOptions, TokenFile};

mod trainer;

fn main() -> Result<(), Box<dyn Error>> {
    env_logger::Builder::from_env(env_logger::Env::default().default_filter_or("info")).init();
    let folder = tempfile::tempdir()?;
    let socket = folder.path().join("socket");
    let mut arguments = env::args().skip(1);
    let mut options = InstructorOptions::new(&socket);
    if let Some(address) = arguments.next() {
        options.bind = address.parse()?;
    }
    let journal = arguments.next().map(PathBuf::from);
    let tokens = folder.path().join("tokens");
    let token = TokenFile::new(&tokens).add("anna")?;
    options.tokens = Some(tokens);
    options.library = Some(folder.path().join("library"));
    let _trainer = trainer::FakeTrainer::start(&socket, journal.as_deref())?;
    let instructor = Instructor::bind(options)?;
    eprintln!("page:  {}\ntoken: {token}", instructor.url());
    // It ends as its process is ended; the folder is left to the system then.
    let ends = AtomicBool::new(false);
    instructor.serve(|| ends.load(Ordering::Relaxed))?;
    Ok(())
}
