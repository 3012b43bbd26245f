//! Classifies HTTP requests. Each must contain the token of the view's address. Only pages that this server served may connect. A page
//! from elsewhere could otherwise reach the server by a name that resolves to this machine (DNS rebinding).

use super::token::Token;

/// What a client requests.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Request {
    /// The page.
    Page,
    /// The WebSocket.
    Socket,
    /// Refused with this status.
    Refused(&'static str),
}

/// Greatest length of a request head, bytes.
pub(crate) const MAX_HEAD: usize = 8 << 10;

/// What a request must know to be answered.
pub(crate) struct Door {
    /// The port of this server.
    pub(crate) port: u16,
    /// The secret in its address.
    pub(crate) token: Token,
}

/// Classifies a request by its head, which ends before the empty line.
pub(crate) fn classify(head: &str, door: &Door) -> Request {
    let port = door.port;
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
        return Request::Refused("403 Forbidden");
    }
    let from_own = |origin: &&str| own.iter().any(|name| origin.strip_prefix("http://") == Some(name));
    if !values("origin").iter().all(from_own) {
        return Request::Refused("403 Forbidden");
    }
    let (path, query) = path.split_once('?').unwrap_or((path, ""));
    if !door.token.is_in(query) {
        return Request::Refused("403 Forbidden");
    }
    match (method, path) {
        ("GET", "/") => Request::Page,
        ("GET", "/socket") => Request::Socket,
        ("GET", _) => Request::Refused("404 Not Found"),
        _ => Request::Refused("405 Method Not Allowed"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Classifies these lines. `TOKEN` stands for the right query.
    fn request(lines: &[&str]) -> Request {
        let door = Door { port: 8080, token: Token::draw().unwrap() };
        classify(&lines.join("\r\n").replace("TOKEN", &door.token.query()), &door)
    }

    #[test]
    fn a_request_without_the_token_is_refused() {
        for path in ["/", "/socket", "/?token=", "/?token=0123456789abcdef0123456789abcdef", "/x"] {
            let refused = request(&[&format!("GET {path} HTTP/1.1"), "Host: 127.0.0.1:8080"]);
            assert_eq!(refused, Request::Refused("403 Forbidden"), "{path}");
        }
    }

    #[test]
    fn pages_of_this_server_are_accepted() {
        for host in ["Host: 127.0.0.1:8080", "host:localhost:8080"] {
            assert_eq!(request(&["GET /TOKEN HTTP/1.1", host]), Request::Page);
            assert_eq!(request(&["GET /socketTOKEN HTTP/1.1", host, "Origin: http://127.0.0.1:8080"]), Request::Socket);
        }
        assert_eq!(request(&["GET /xTOKEN HTTP/1.1", "Host: 127.0.0.1:8080"]), Request::Refused("404 Not Found"));
        assert_eq!(
            request(&["POST /TOKEN HTTP/1.1", "Host: 127.0.0.1:8080"]),
            Request::Refused("405 Method Not Allowed")
        );
    }

    #[test]
    fn other_origins_and_hosts_are_refused() {
        let own = "Host: 127.0.0.1:8080";
        for lines in [
            &["GET /TOKEN HTTP/1.1"][..],
            &["GET /TOKEN HTTP/1.1", "Host: example.org"],
            &["GET /TOKEN HTTP/1.1", "Host: 127.0.0.1"],
            &["GET /TOKEN HTTP/1.1", "Host: 127.0.0.1:80800"],
            &["GET /TOKEN HTTP/1.1", own, "Host: example.org"],
            &["GET /socketTOKEN HTTP/1.1", own, "Origin: http://example.org"],
            &["GET /socketTOKEN HTTP/1.1", own, "Origin: null"],
            &["GET /socketTOKEN HTTP/1.1", own, "Origin: https://127.0.0.1:8080"],
            &["GET /socketTOKEN HTTP/1.1", own, "Origin: http://127.0.0.1:8080.example.org"],
            &["GET /socketTOKEN HTTP/1.1", own, "Origin: http://127.0.0.1:8081"],
        ] {
            assert_eq!(request(lines), Request::Refused("403 Forbidden"), "{lines:?}");
        }
    }
}
