"""Measures ours beside the vendor's SDK on the servos at $SERVOS: compare.py [--seconds S] [--rounds N] [--silent ID].

All take turns, round by round, so that a change of the machine's speed falls on each; what counts are the ratios.
With --silent, servo ID falls silent some seconds after the start of the simulator, and the healthy values and the time
lost are compared instead; ours is the example program `servo_chain`, named by $SERVO_CHAIN.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import time

from dynamixel_sdk import COMM_SUCCESS, GroupSyncRead, GroupSyncWrite, PacketHandler, PortHandler

GOAL_POSITION, PRESENT_LOAD, STATE_BYTES, BAUD = 116, 126, 10, 1_000_000
IDS = range(1, 13)
SERVOS, HANDWAVE = os.environ["SERVOS"], os.environ["HANDWAVE"]


class Sdk:
    """The cycle as a user of the SDK writes it: a sync write of goals, a sync read of states."""

    def __init__(self):
        self.port, self.packet = PortHandler(SERVOS), PacketHandler(2.0)
        self.port.openPort()
        self.port.setBaudRate(BAUD)
        self.goals = GroupSyncWrite(self.port, self.packet, GOAL_POSITION, 4)
        self.states = GroupSyncRead(self.port, self.packet, PRESENT_LOAD, STATE_BYTES)
        for servo in IDS:
            self.goals.addParam(servo, list((2048).to_bytes(4, "little")))
            self.states.addParam(servo)

    def cycle(self, fast):
        """One cycle; how many servos' values came."""
        for servo in IDS:
            self.goals.changeParam(servo, list((2048).to_bytes(4, "little")))
            self.states.data_dict[servo] = []
        self.goals.txPacket()
        result = self.states.fastSyncRead() if fast else self.states.txRxPacket()
        if result == COMM_SUCCESS:
            return sum(
                self.states.isAvailable(servo, PRESENT_LOAD, STATE_BYTES) for servo in IDS
            )
        # isAvailable() says no for all then; what came is there all the same.
        return sum(len(self.states.data_dict[servo]) == STATE_BYTES for servo in IDS)

    def run(self, seconds, fast):
        """Cycles per second, processor microseconds a cycle, values a cycle."""
        cycles = values = 0
        begin, cpu = time.monotonic(), time.process_time()
        while time.monotonic() - begin < seconds:
            values += self.cycle(fast)
            cycles += 1
        span, cpu = time.monotonic() - begin, time.process_time() - cpu
        return cycles / span, 1e6 * cpu / cycles, values / cycles

    def close(self):
        self.port.closePort()


def ours(seconds, fast):
    args = [HANDWAVE, "bus", "bench", f"dynamixel:{SERVOS}@{BAUD}", "--ids", "1-12", "--json"]
    args += ["--seconds", str(seconds), "--reads", "fast" if fast else "ordinary"]
    row = json.loads(subprocess.run(args, check=True, capture_output=True).stdout)
    return row["cycles_per_s"], row["cpu_us"], row["fresh"] / row["cycles"]


def sdk(seconds, fast):
    client = Sdk()
    try:
        return client.run(seconds, fast)
    finally:
        client.close()


def compare(seconds, rounds):
    columns = [
        ("Handwave, fast reads", ours, True),
        ("SDK, fast reads", sdk, True),
        ("Handwave, ordinary reads", ours, False),
        ("SDK, ordinary reads", sdk, False),
    ]
    table = {name: [] for name, _, _ in columns}
    for _ in range(rounds):
        for name, run, fast in columns:
            table[name].append(run(seconds, fast))
    middle = lambda values: statistics.median(values)
    base = table["SDK, ordinary reads"]
    print("|  | cycles/s | times SDK, ordinary | processor us a cycle | values a cycle |")
    print("|---|---|---|---|---|")
    for name, rows in table.items():
        ratio = middle([row[0] / other[0] for row, other in zip(rows, base)])
        rate, cpu, values = (middle([row[index] for row in rows]) for index in range(3))
        print(f"| {name} | {rate:.0f} | {ratio:.2f} | {cpu:.0f} | {values:.2f} |")


def silent(servo, seconds):
    args = [os.environ["SERVO_CHAIN"], f"dynamixel:{SERVOS}@{BAUD}", "12", str(2 * seconds)]
    print(f"Handwave (the driver of `run`, 200 Hz), servo {servo} falls silent:")
    print(subprocess.run(args, check=True, capture_output=True, text=True).stdout, end="")
    for fast in (False, True):
        client = Sdk()
        times, values = [], []
        begin = time.monotonic()
        while time.monotonic() - begin < seconds:
            start = time.monotonic()
            values.append(client.cycle(fast))
            times.append(1e3 * (time.monotonic() - start))
        client.close()
        name = "fast" if fast else "ordinary"
        print(
            f"SDK, {name} reads, servo {servo} silent: values {statistics.mean(values):.2f} a cycle, "
            f"cycle median {statistics.median(times):.1f} ms"
        )


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--silent", type=int)
    args = parser.parse_args()
    if args.silent is None:
        compare(args.seconds, args.rounds)
    else:
        silent(args.silent, args.seconds)


if __name__ == "__main__":
    sys.exit(main())
