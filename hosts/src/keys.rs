//! Makes the certificates by which hosts and launchers know each other.

use crate::error::HostsError;
use crate::network::Side;
use rcgen::{
    BasicConstraints, CertificateParams, DnType, ExtendedKeyUsagePurpose, IsCa, Issuer, KeyPair, KeyUsagePurpose,
};
use std::fs::{DirBuilder, OpenOptions};
use std::io::Write;
use std::os::unix::fs::{DirBuilderExt, OpenOptionsExt};
use std::path::Path;

/// Makes a folder with an authority's certificate, and with a certificate and a key of hosts and of launchers. The authority's key is
/// not kept: no one can sign others with it.
///
/// # Errors
/// [`HostsError::System`] if the folder exists or cannot be written, [`HostsError::Keys`].
pub(crate) fn make(folder: &Path) -> Result<(), HostsError> {
    let made = DirBuilder::new().mode(0o700).create(folder);
    made.map_err(HostsError::system(format!("making the folder {}", folder.display())))?;
    let mut authority = named("Skein authority")?;
    authority.is_ca = IsCa::Ca(BasicConstraints::Constrained(0));
    authority.key_usages = vec![KeyUsagePurpose::KeyCertSign, KeyUsagePurpose::CrlSign];
    let key = KeyPair::generate()?;
    write(folder, "authority.pem", &authority.self_signed(&key)?.pem())?;
    let issuer = Issuer::new(authority, key);
    for side in [Side::Host, Side::Launcher] {
        let mut params = named(&format!("Skein {}", side.word()))?;
        params.extended_key_usages = vec![ExtendedKeyUsagePurpose::ServerAuth, ExtendedKeyUsagePurpose::ClientAuth];
        params.key_usages = vec![KeyUsagePurpose::DigitalSignature];
        let key = KeyPair::generate()?;
        write(folder, &format!("{}.pem", side.word()), &params.signed_by(&key, &issuer)?.pem())?;
        write(folder, &format!("{}-key.pem", side.word()), &key.serialize_pem())?;
    }
    Ok(())
}

fn named(name: &str) -> Result<CertificateParams, HostsError> {
    let mut params = CertificateParams::new(vec!["skein".to_owned()])?;
    params.distinguished_name.push(DnType::CommonName, name);
    Ok(params)
}

fn write(folder: &Path, name: &str, text: &str) -> Result<(), HostsError> {
    let path = folder.join(name);
    let file = OpenOptions::new().write(true).create_new(true).mode(0o600).open(&path);
    let written = file.and_then(|mut file| file.write_all(text.as_bytes()));
    written.map_err(HostsError::system(format!("writing {}", path.display())))
}
