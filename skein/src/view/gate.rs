//! Who may come in: this machine's browser, for a page that this server gave it. A page from elsewhere could otherwise
//! reach the server through a name that resolves to this machine.

/// What a client asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Asked {
    /// The page.
    Page,
    /// The socket.
    Socket,
    /// To be refused with this status.
    Refused(&'static str),
}

/// Longest request head, bytes.
pub const HEAD_MAX: usize = 8 << 10;

/// Judges a request by its head, up to the empty line.
pub fn judge(head: &str, port: u16) -> Asked {
    let mut lines = head.split("\r\n");
    let mut request = lines.next().unwrap_or_default().split(' ');
    let (method, path) = (request.next().unwrap_or_default(), request.next().unwrap_or_default());
    let fields: Vec<(&str, &str)> = lines.filter_map(|line| line.split_once(':')).collect();
    let values = |name: &str| -> Vec<&str> {
        fields.iter().filter(|field| field.0.eq_ignore_ascii_case(name)).map(|field| field.1.trim()).collect()
    };
    let own = [format!("127.0.0.1:{port}"), format!("localhost:{port}")];
    let hosts = values("host");
    if hosts.len() != 1 || !own.iter().any(|name| name == hosts[0]) {
        return Asked::Refused("403 Forbidden");
    }
    let from_own = |origin: &&str| own.iter().any(|name| origin.strip_prefix("http://") == Some(name));
    if !values("origin").iter().all(from_own) {
        return Asked::Refused("403 Forbidden");
    }
    match (method, path.split('?').next().unwrap_or_default()) {
        ("GET", "/") => Asked::Page,
        ("GET", "/socket") => Asked::Socket,
        ("GET", _) => Asked::Refused("404 Not Found"),
        _ => Asked::Refused("405 Method Not Allowed"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(lines: &[&str]) -> Asked {
        judge(&lines.join("\r\n"), 8080)
    }

    #[test]
    fn this_machines_page_is_let_in() {
        for host in ["Host: 127.0.0.1:8080", "host:localhost:8080"] {
            assert_eq!(asked(&["GET / HTTP/1.1", host]), Asked::Page);
            assert_eq!(asked(&["GET /socket HTTP/1.1", host, "Origin: http://127.0.0.1:8080"]), Asked::Socket);
        }
        assert_eq!(asked(&["GET /x HTTP/1.1", "Host: 127.0.0.1:8080"]), Asked::Refused("404 Not Found"));
        assert_eq!(asked(&["POST / HTTP/1.1", "Host: 127.0.0.1:8080"]), Asked::Refused("405 Method Not Allowed"));
    }

    #[test]
    fn others_are_not() {
        let own = "Host: 127.0.0.1:8080";
        for lines in [
            &["GET / HTTP/1.1"][..],
            &["GET / HTTP/1.1", "Host: example.org"],
            &["GET / HTTP/1.1", "Host: 127.0.0.1"],
            &["GET / HTTP/1.1", "Host: 127.0.0.1:80800"],
            &["GET / HTTP/1.1", own, "Host: example.org"],
            &["GET /socket HTTP/1.1", own, "Origin: http://example.org"],
            &["GET /socket HTTP/1.1", own, "Origin: null"],
            &["GET /socket HTTP/1.1", own, "Origin: https://127.0.0.1:8080"],
            &["GET /socket HTTP/1.1", own, "Origin: http://127.0.0.1:8080.example.org"],
            &["GET /socket HTTP/1.1", own, "Origin: http://127.0.0.1:8081"],
        ] {
            assert_eq!(asked(lines), Asked::Refused("403 Forbidden"), "{lines:?}");
        }
    }
}
