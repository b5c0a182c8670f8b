"""A raw client of ZMTP 3 with CURVE, which sends what libzmq never would: frames that do not end, messages of endless
parts, any bytes instead of a handshake.

    connection = zmtp.Connection(("127.0.0.1", 7400))            # Only a TCP connection.
    connection = zmtp.connect(address, server_key, keys, b"1")   # A DEALER with routing id 1, after the handshake.
    connection.send(b"...", more=True)

Keys are CURVE's, 32 bytes. ZMTP: https://rfc.zeromq.org/spec/23/, CURVE: https://rfc.zeromq.org/spec/26/.
"""
import socket
import struct

import nacl.bindings as sodium
import nacl.exceptions
import nacl.utils

TIMEOUT_S = 10
GREETING = b"\xff" + bytes(8) + b"\x7f" + b"\x03\x00" + b"CURVE".ljust(20, b"\0") + b"\0" + bytes(31)
MORE, LONG, COMMAND = 1, 2, 4
Z85 = "0123456789abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ.-:+=^!/*?&<>()[]{}@%$#"


def from_z85(text):
    number_of = {letter: number for number, letter in enumerate(Z85)}
    words = []
    for i in range(0, len(text), 5):
        word = 0
        for letter in text[i:i + 5]:
            word = 85 * word + number_of[letter]
        words.append(struct.pack(">I", word))
    return b"".join(words)


def key_pair():
    """Returns a new (public, secret) key pair of no agent or client."""
    return sodium.crypto_box_keypair()


class Connection:
    def __init__(self, address, timeout_s=TIMEOUT_S, accepted=None):
        self.socket = accepted or socket.create_connection(address, timeout=timeout_s)
        self.nonce = 0
        self.nonce_prefix = b"CurveZMQMESSAGEC"
        self.session_keys = None  # After the handshake: (public key of the server, secret key of this connection).

    def close(self):
        self.socket.close()

    def send_raw(self, data):
        self.socket.sendall(data)

    def send_frame(self, body, flags=0):
        if len(body) > 255:
            self.send_raw(struct.pack(">BQ", flags | LONG, len(body)) + body)
        else:
            self.send_raw(struct.pack(">BB", flags, len(body)) + body)

    def receive_raw(self, size):
        data = b""
        while len(data) < size:
            part = self.socket.recv(size - len(data))
            if not part:
                raise ConnectionError("the other side closed")
            data += part
        return data

    def receive_frame(self):
        flags = self.receive_raw(1)[0]
        size = struct.unpack(">Q", self.receive_raw(8))[0] if flags & LONG else self.receive_raw(1)[0]
        return flags, self.receive_raw(size)

    def is_closed_within(self, seconds):
        """Returns whether the other side closes the connection. Discards received bytes."""
        self.socket.settimeout(seconds)
        try:
            while self.socket.recv(65536):
                pass
            return True
        except TimeoutError:
            return False
        except OSError:
            return True

    def part(self, payload, more=False):
        """Returns one part of a message in wire format."""
        self.nonce += 1
        short = struct.pack(">Q", self.nonce)
        public, secret = self.session_keys
        box = sodium.crypto_box(bytes([MORE if more else 0]) + payload, self.nonce_prefix + short, public, secret)
        body = b"\x07MESSAGE" + short + box
        return (struct.pack(">BQ", LONG, len(body)) if len(body) > 255 else struct.pack(">BB", 0, len(body))) + body

    def send(self, payload, more=False):
        self.send_raw(self.part(payload, more))


def connect(address, server_key, keys, routing_id=b"", timeout_s=TIMEOUT_S, make=Connection, properties=()):
    """Connects and runs the client's side of the handshake. `make` creates the Connection. `properties` are pairs
    of bytes that are added to the handshake's metadata."""
    connection = make(address, timeout_s)
    connection.send_raw(GREETING)
    connection.receive_raw(64)
    public, secret = keys
    own_public, own_secret = sodium.crypto_box_keypair()
    short = struct.pack(">Q", 1)
    hello = sodium.crypto_box(bytes(64), b"CurveZMQHELLO---" + short, server_key, own_secret)
    connection.send_frame(b"\x05HELLO\x01\x00" + bytes(72) + own_public + short + hello, COMMAND)
    _, welcome = connection.receive_frame()
    if not welcome.startswith(b"\x07WELCOME"):
        raise ConnectionError("no welcome")
    opened = sodium.crypto_box_open(welcome[24:], b"WELCOME-" + welcome[8:24], server_key, own_secret)
    server_public, cookie = opened[:32], opened[32:]
    vouch_nonce = nacl.utils.random(16)
    vouch = sodium.crypto_box(own_public + server_key, b"VOUCH---" + vouch_nonce, server_public, secret)
    metadata = b"".join(struct.pack(">B", len(name)) + name + struct.pack(">I", len(value)) + value
                        for name, value in ((b"Socket-Type", b"DEALER"), (b"Identity", routing_id), *properties))
    short = struct.pack(">Q", 2)
    box = sodium.crypto_box(public + vouch_nonce + vouch + metadata, b"CurveZMQINITIATE" + short, server_public,
                            own_secret)
    connection.send_frame(b"\x08INITIATE" + cookie + short + box, COMMAND)
    _, ready = connection.receive_frame()
    if not ready.startswith(b"\x05READY"):
        raise ConnectionError("not admitted")
    connection.nonce = 2
    connection.session_keys = (server_public, own_secret)
    return connection


def accept(accepted, secret):
    """Runs the server's side of the handshake over an accepted socket. Accepts any key, and stores it as
    `peer_key`."""
    connection = Connection(None, accepted=accepted)
    connection.send_raw(GREETING[:32] + b"\x01" + GREETING[33:])
    connection.receive_raw(64)
    _, hello = connection.receive_frame()
    client_public = hello[80:112]
    own_public, own_secret = sodium.crypto_box_keypair()
    nonce = nacl.utils.random(16)
    box = sodium.crypto_box(own_public + nacl.utils.random(96), b"WELCOME-" + nonce, client_public, secret)
    connection.send_frame(b"\x07WELCOME" + nonce + box, COMMAND)
    _, initiate = connection.receive_frame()
    nonce = b"CurveZMQINITIATE" + initiate[105:113]
    connection.peer_key = sodium.crypto_box_open(initiate[113:], nonce, client_public, own_secret)[:32]
    short = struct.pack(">Q", 1)
    metadata = b"\x0bSocket-Type\x00\x00\x00\x06ROUTER\x08Identity\x00\x00\x00\x00"
    ready = sodium.crypto_box(metadata, b"CurveZMQREADY---" + short, client_public, own_secret)
    connection.send_frame(b"\x05READY" + short + ready, COMMAND)
    connection.nonce, connection.nonce_prefix = 1, b"CurveZMQMESSAGES"
    connection.session_keys = (client_public, own_secret)
    return connection


def public_of(secret):
    return sodium.crypto_scalarmult_base(secret)
