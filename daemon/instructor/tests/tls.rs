//! The page over TLS. Certificate and key beside this file are for nothing but this test; they end in a hundred years.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, reason = "a test fails by panicking")]

mod support;

use std::{
    io::{Read as _, Write as _},
    path::{Path, PathBuf},
    sync::Arc,
};

use bowwave_instructor::{Instructor, InstructorOptions, TlsFiles};
use support::{Answer, Server};
use tokio_rustls::rustls::{
    ClientConfig, ClientConnection, RootCertStore, Stream,
    crypto::ring,
    pki_types::{CertificateDer, ServerName, pem::PemObject as _},
};

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tls").join(name)
}

fn files() -> TlsFiles {
    TlsFiles { certificate: file("certificate.pem"), key: file("key.pem") }
}

/// An answer to a request over TLS.
fn ask(server: &Server, text: &str) -> Answer {
    let mut roots = RootCertStore::empty();
    roots.add(CertificateDer::from_pem_file(file("certificate.pem")).unwrap()).unwrap();
    let config = ClientConfig::builder_with_provider(Arc::new(ring::default_provider()))
        .with_safe_default_protocol_versions()
        .unwrap()
        .with_root_certificates(roots)
        .with_no_client_auth();
    let name = ServerName::try_from("127.0.0.1").unwrap();
    let mut connection = ClientConnection::new(Arc::new(config), name).unwrap();
    let mut stream = server.connect();
    let mut tls = Stream::new(&mut connection, &mut stream);
    tls.write_all(text.as_bytes()).unwrap();
    let mut answer = Vec::new();
    let _ = tls.read_to_end(&mut answer);
    Answer::of(&String::from_utf8_lossy(&answer))
}

#[test]
fn the_page_is_served_over_tls_and_by_no_other_way() {
    let server = Server::with(true, |options| options.tls = Some(files()));
    let own = server.address;
    let page = ask(&server, &format!("GET / HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\n\r\n"));
    assert_eq!(page.status, 200);
    let token = &server.anna;
    let head = format!(
        "POST /login HTTP/1.1\r\nHost: {own}\r\nConnection: close\r\nContent-Length: {}\r\n",
        token.len()
    );
    let login = ask(&server, &format!("{head}Origin: https://{own}\r\n\r\n{token}"));
    assert!(login.status == 200 && login.head.contains("; secure"), "{} {}", login.status, login.head);
    let plain = ask(&server, &format!("{head}Origin: http://{own}\r\n\r\n{token}"));
    assert_eq!(plain.status, 403, "the origin of a page without TLS is another one");
    assert_eq!(server.ask("GET", "/", None, "").status, 0, "plain HTTP is not answered");
}

#[test]
fn files_that_cannot_be_used_are_named() {
    let bind = |certificate: &str, key: &str| {
        let mut options = InstructorOptions::new("/nowhere");
        options.bind = "127.0.0.1:0".parse().unwrap();
        options.tls = Some(TlsFiles { certificate: file(certificate), key: file(key) });
        Instructor::bind(options).map(|_| ()).map_err(|error| error.to_string())
    };
    assert!(bind("certificate.pem", "key.pem").is_ok());
    assert!(bind("missing.pem", "key.pem").unwrap_err().contains("missing.pem"));
    assert!(bind("key.pem", "key.pem").unwrap_err().contains("no certificate"));
    assert!(bind("certificate.pem", "certificate.pem").unwrap_err().contains("PEM"));
}
