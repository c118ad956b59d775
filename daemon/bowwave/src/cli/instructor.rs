//! Arguments of `instructor`.

use std::{net::SocketAddr, path::PathBuf};

use clap::{Args, Subcommand};

/// The trainer's socket as the installed configuration has it.
const SOCKET: &str = "/run/bowwave/instructor.sock";
/// The service's own folder.
const STATE: &str = "/var/lib/bowwave-instructor";

/// Arguments of `instructor`.
#[derive(Debug, Args)]
#[command(args_conflicts_with_subcommands = true)]
pub struct InstructorArgs {
    /// Tokens instead: who may steer
    #[command(subcommand)]
    pub command: Option<InstructorCommand>,
    /// The trainer's socket: instructor.socket of its configuration, or that of `bowwave play --instructor`
    #[arg(long, value_name = "SOCKET", default_value = SOCKET)]
    pub socket: PathBuf,
    /// Address and port of the page; 0.0.0.0:8370 for the whole local network
    #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:8370")]
    pub bind: SocketAddr,
    /// Name that browsers call this computer by, besides its addresses; may be given several times
    #[arg(long, value_name = "HOST")]
    pub name: Vec<String>,
    /// Certificate for TLS (PEM), with those that lead to its authority
    #[arg(long, value_name = "FILE", requires = "key")]
    pub certificate: Option<PathBuf>,
    /// Its private key (PEM)
    #[arg(long, value_name = "FILE", requires = "certificate")]
    pub key: Option<PathBuf>,
    /// Serve other computers without TLS: everybody on the network can read tokens and pictures then
    #[arg(long, conflicts_with = "certificate")]
    pub without_tls: bool,
    /// Let whoever opens the page steer the trainer as long as there is no token
    #[arg(long)]
    pub without_token: bool,
    /// File of tokens
    #[command(flatten)]
    pub tokens: TokenArgs,
    /// Folder of the instructor's own scenarios, which the page can write to
    #[arg(long, value_name = "DIR", default_value_os_t = default_library())]
    pub library: PathBuf,
    /// Most pictures a second
    #[arg(long, value_name = "N", default_value_t = 15.0)]
    pub picture_rate: f64,
}

/// The file of tokens.
#[derive(Debug, Args)]
pub struct TokenArgs {
    /// File of the tokens' hashes
    #[arg(long, value_name = "FILE", default_value_os_t = default_tokens())]
    pub tokens: PathBuf,
}

fn default_tokens() -> PathBuf {
    PathBuf::from(STATE).join("tokens")
}

fn default_library() -> PathBuf {
    PathBuf::from(STATE).join("scenarios")
}

/// Commands besides serving.
#[derive(Debug, Subcommand)]
pub enum InstructorCommand {
    /// Tokens of those who may steer
    #[command(subcommand)]
    Token(TokenCommand),
}

/// Tokens of those who may steer.
#[derive(Debug, Subcommand)]
pub enum TokenCommand {
    /// Make a token and print it once: only its hash is kept
    Add(NamedToken),
    /// List the tokens by name
    List(TokenArgs),
    /// Take a token back: whoever uses it is let go at once
    Revoke(NamedToken),
}

/// A token by its name.
#[derive(Debug, Args)]
pub struct NamedToken {
    /// Whose it is, as everybody at the page sees it
    pub name: String,
    /// File of tokens
    #[command(flatten)]
    pub tokens: TokenArgs,
}
