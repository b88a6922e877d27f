"""Where the page is, for everybody and for the owner, and whose program is connected to it."""

import os
import pwd
import re
import socket
from pathlib import Path

from fti.service.page_access import PageAccess
from fti.service.tcp_user import user_of_connection


def test_the_key_is_announced_to_a_terminal_alone() -> None:
    for shows_key, said in ((False, r"display at http://127\.0\.0\.1:81/"), (True, r".*:81/#key=[\w-]{43}")):
        access = PageAccess("127.0.0.1", shows_key=shows_key)
        assert (access.url, access.owner_url) == (None, None)
        access.on_port(81)
        assert re.fullmatch(said, access.announcement)
        assert access.owner_url == f"http://127.0.0.1:81/#key={access.key}"


def test_each_start_has_a_key_of_its_own() -> None:
    assert len({PageAccess("127.0.0.1", shows_key=False).key for _ in range(100)}) == 100


def test_the_user_of_a_connection_is_known() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server, socket.create_connection(server.getsockname()) as client:
        ours, _ = server.accept()
        with ours:
            assert user_of_connection(ours.getpeername(), ours.getsockname()) == pwd.getpwuid(os.geteuid()).pw_name
            assert user_of_connection(("127.0.0.1", 1), client.getsockname()) == "an unknown user"


def test_another_user_is_named_as_the_kernel_lists_him(tmp_path: Path) -> None:
    table = tmp_path / "tcp"  # of Linux 6.1, x86-64
    table.write_text(
        "  sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"
        "   0: 0100007F:1F90 00000000:0000 0A 00000000:00000000 00:00000000 00000000     0        0 21107 1 0 100 0 0\n"
        "   1: 0100007F:1F90 0100007F:C350 01 00000000:00000000 00:00000000 00000000     0        0 21108 1 0 20 4 30\n"
        "   2: 0100007F:C350 0100007F:1F90 01 00000000:00000000 00:00000000 00000000 54321        0 21109 1 0 20 4 30\n"
    )
    assert user_of_connection(("127.0.0.1", 50000), ("127.0.0.1", 8080), table) == "user 54321"
    assert user_of_connection(("127.0.0.1", 50000), ("127.0.0.1", 8080), tmp_path / "none") == "an unknown user"
