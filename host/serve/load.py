#!/usr/bin/env python3
"""`mgw serve` under load, by hand: 32 programs, one that does not read, one that floods, kill -9 of the one in command, the
cable out.

    host/serve/load.py [MGW [SECONDS]]    MGW: the program, target/debug/mgw unless told otherwise

Prints how long stops took through the loaded server (from the write of the request to its answer, with the simulator behind
it), how long the axis of a killed program turned on, and how soon the server was back after the cable. Fails when a stop is
not answered, an axis turns on, or a program is not served.
"""

import json, os, random, socket, struct, subprocess, sys, tempfile, threading, time

MGW = sys.argv[1] if len(sys.argv) > 1 else "target/debug/mgw"
SECONDS = float(sys.argv[2]) if len(sys.argv) > 2 else 120
WATCHERS, SILENCE_US = 29, 1_000_000
folder = tempfile.mkdtemp()
SOCKET = os.path.join(folder, "mgw.sock")
ENV = {**os.environ, "MGW_SOCKET": SOCKET}
ENV.pop("MGW_PORT", None)


def crc(data):
    value = 0xFFFFFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = (value >> 1) ^ (0x82F63B78 if value & 1 else 0)
    return value ^ 0xFFFFFFFF


def frame(sequence, number, body=b""):
    message = bytes([1]) + struct.pack("<HH", sequence, number) + body
    message += struct.pack("<I", crc(message))
    blocks = message.split(b"\0")
    return b"\0" + b"".join(bytes([len(block) + 1]) + block for block in blocks) + b"\0"


def replies(data):
    """Kind, sequence and number of each frame."""
    for part in data.split(b"\0"):
        out, at = b"", 0
        while at < len(part):
            out += part[at + 1 : at + part[at]] + b"\0"
            at += part[at]
        if len(out) >= 6:
            yield out[0], *struct.unpack("<HH", out[1:5])


def connect():
    stream = socket.socket(socket.AF_UNIX)
    stream.settimeout(10)
    stream.connect(SOCKET)
    return stream


def ask(stream, sequence, number, body=b""):
    """Seconds until it is answered."""
    start, data = time.monotonic(), b""
    stream.sendall(frame(sequence, number, body))
    while not any(kind in (2, 3) and of == sequence for kind, of, _ in replies(data)):
        data += stream.recv(4096)
    return time.monotonic() - start


class Cable:
    """Between server and simulator; it can be cut."""

    def __init__(self, port):
        self.port, self.pairs, self.cut = port, [], False
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.name = f"tcp:127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        while True:
            one, _ = self.listener.accept()
            if self.cut:
                one.close()
                continue
            two = socket.create_connection(("127.0.0.1", self.port))
            for end in (one, two):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self.pairs += [one, two]
            for a, b in ((one, two), (two, one)):
                threading.Thread(target=self.carry, args=(a, b), daemon=True).start()

    def carry(self, a, b):
        try:
            while data := a.recv(4096):
                b.sendall(data)
        except OSError:
            pass

    def pull(self):
        self.cut = True
        for end in self.pairs:
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass
        self.pairs = []


def start(*arguments):
    return subprocess.Popen([MGW, *arguments], env=ENV, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)


def mgw(*arguments):
    return subprocess.run([MGW, *arguments], env=ENV, text=True, capture_output=True, timeout=60)


def state():
    out = mgw("--json", "state", "0").stdout
    return json.loads(out)["axes"][0] if out.startswith("{") else {"state": "?"}


def until(what, seconds=30):
    begin = time.monotonic()
    while not what():
        assert time.monotonic() - begin < seconds, "it does not come to that"
        time.sleep(0.02)
    return time.monotonic() - begin


def drain(process):
    threading.Thread(target=lambda: [None for _ in process.stdout], daemon=True).start()
    return process


sim = start("sim", "--listen", "127.0.0.1:0")
port = int(next(line for line in sim.stdout if line.startswith("listening on ")).strip().rsplit(":", 1)[1])
drain(sim)
direct = ["--port", f"tcp:127.0.0.1:{port}"]
assert mgw(*direct, "config", "gateway", f"link_silence_us={SILENCE_US}").returncode == 0
until(lambda: mgw(*direct, "config", "axis", "0", "ttl_us=5000000").returncode == 0)
time.sleep(1.2)
cable = Cable(port)
server = drain(start("--port", cable.name, "serve", "--listen", "127.0.0.1:0", "--socket", SOCKET))
until(lambda: mgw("info").returncode == 0)


def median(times):
    times = sorted(times)
    return f"{len(times):4}  median {times[len(times) // 2] * 1e3:7.2f} ms  longest {times[-1] * 1e3:7.2f} ms" if times else "none"


quiet = connect()
quiet_stops = [ask(quiet, sequence, 0x32, b"\1") for sequence in range(1, 40)]
ends = False


def flood():
    while not ends:
        try:
            stream, sequence = connect(), 0
            stream.setblocking(True)
            threading.Thread(target=lambda: drain_socket(stream), daemon=True).start()
            while not ends:
                stream.sendall(b"".join(frame((sequence + i) & 0xFFFF, 0x02) for i in range(20)))
                sequence += 20
        except OSError:
            time.sleep(0.1)


def drain_socket(stream):
    try:
        while stream.recv(65536):
            pass
    except OSError:
        pass


def watchers():
    return [drain(start("--json", "watch", "0", "--period", "50")) for _ in range(WATCHERS)]


threading.Thread(target=flood, daemon=True).start()
begin, watching = time.monotonic(), watchers()
deaf = start("--json", "watch", "0", "--period", "1")
time.sleep(2)
deaf.send_signal(19)
stops, turned_on, back, killed, cut = [], [], [], 0, 0
stream, sequence = connect(), 100
while time.monotonic() - begin < SECONDS:
    until(lambda: mgw("clear", "0").returncode in (0, 1) and state()["state"] in ("idle", "holding"))
    mover = drain(start("set", "0", "velocity", "2", "--for", "60"))
    until(lambda: state()["state"] == "active")
    deed = random.choice(("stop", "stop", "kill", "cable"))
    if deed == "stop":
        for _ in range(10):
            sequence += 1
            stops.append(ask(stream, sequence & 0xFFFF, 0x32, b"\1"))
        mover.wait(30)
    elif deed == "kill":
        mover.kill()
        mover.wait()
        turned_on.append(until(lambda: state()["state"] == "tripped"))
        killed += 1
    else:
        cable.pull()
        mover.wait(30)
        # Straight at the gateway, over a link of its own: the axis has stopped by itself.
        look = lambda: json.loads(mgw(*direct, "--json", "state", "0").stdout)["axes"][0]["state"]
        turned_on.append(until(lambda: look() == "tripped"))
        cable.cut = False
        back.append(until(lambda: mgw("info").returncode == 0))
        for process in watching + [deaf]:
            process.kill()
        watching, deaf, cut = watchers(), start("--json", "watch", "0", "--period", "1"), cut + 1
        time.sleep(1)
        deaf.send_signal(19)
        stream = connect()
assert server.poll() is None, "the server has ended"
alive = sum(process.poll() is None for process in watching)
ends = True
with open(f"/proc/{server.pid}/status") as status:
    memory = next(line.split()[1] for line in status if line.startswith("VmRSS"))
print(f"{WATCHERS + 3} programs for {time.monotonic() - begin:.0f} s; {killed} killed in command, the cable out {cut} times")
print(f"stops without load           {median(quiet_stops)}")
print(f"stops under load             {median(stops)}")
print(f"killed or cut, until tripped {median(turned_on)}   (link silence {SILENCE_US / 1e3:.0f} ms)")
print(f"cable in, until served again {median(back)}")
print(f"watchers still served at the end: {alive} of {WATCHERS}; memory of the server: {memory} KiB")
for process in watching + [deaf, server, sim]:
    process.kill()
assert alive == WATCHERS
