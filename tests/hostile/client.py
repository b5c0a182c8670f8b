"""A client from elsewhere, with a key of the team's list: what moonctl --key is, and whatever an attacker sends instead."""
from messages import control
from team import CLIENT_PORT, STEP_LIMIT_S, AgentError, Failure, Client


class KeyedClient(Client):
    """A client with its own key at rover1's client_address, over one connection. `call(request)` sends a request
    and waits for the ControlReply. With `from_address`, the connection comes from that address, as from another
    computer."""

    def __init__(self, team, key_name, timeout_s=STEP_LIMIT_S, from_address="127.0.0.1"):
        _, secret = team.client_keys(key_name)
        server_key, _ = team.z85_keys("rover1")
        super().__init__(f"tcp://{from_address}:0;127.0.0.1:{CLIENT_PORT}", team.team_id.hex(), timeout_s,
                         server_key.decode(), secret.decode())
        self._by = "carl@hill"

    def ask(self, timeout_s=None, **request):
        """Returns the ControlReply. Raises Failure for an error or if no reply arrives."""
        try:
            return self.call(control.ControlRequest(**request), timeout_s)
        except (AgentError, TimeoutError) as error:
            raise Failure(f"{request}: {error}") from error

    def send(self, request_id=1, **request):
        """Sends a request and does not wait for the reply."""
        asked = control.ControlRequest(team_id=self._team_id, **{"by": self._by, **request})
        self.send_bytes(control.ClientMessage(request_id=request_id, control_request=asked).SerializeToString())

    def send_bytes(self, data):
        self._dealer.send(data)

    def receive(self, timeout_s):
        """Returns the next ClientMessage, or None if none arrives in time."""
        return control.ClientMessage.FromString(self._dealer.recv()) if self._dealer.poll(1000 * timeout_s) else None
