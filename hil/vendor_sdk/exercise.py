"""Exercises servos 1 to 12 on PORT at BAUD with the vendor's SDK: exercise.py PORT BAUD. Exit code 0 when all agree."""

import importlib.metadata
import sys
import time

from dynamixel_sdk import (
    COMM_SUCCESS,
    GroupBulkRead,
    GroupSyncRead,
    GroupSyncWrite,
    PacketHandler,
    PortHandler,
)

TORQUE_ENABLE, LED, GOAL_POSITION, PRESENT_LOAD, PRESENT_POSITION = 64, 65, 116, 126, 132
IDS = range(1, 13)
failures = 0


def check(what, ok, found=""):
    global failures
    failures += not ok
    print(f"{'ok  ' if ok else 'FAIL'} {what} {found}")


def four(value):
    return list(value.to_bytes(4, "little"))


def main(path, baud):
    port, packet = PortHandler(path), PacketHandler(2.0)
    port.openPort()
    port.setBaudRate(baud)
    print("dynamixel-sdk", importlib.metadata.version("dynamixel-sdk"))

    model, comm, error = packet.ping(port, 3)
    check("ping 3", (model, comm, error) == (1060, COMM_SUCCESS, 0), model)
    found, comm = packet.broadcastPing(port)
    check("broadcast ping", sorted(found) == list(IDS), sorted(found))
    position, comm, error = packet.read4ByteTxRx(port, 5, PRESENT_POSITION)
    check("read", (position, comm, error) == (2048, COMM_SUCCESS, 0), position)
    comm, error = packet.write1ByteTxRx(port, 5, LED, 1)
    check("write", (comm, error) == (COMM_SUCCESS, 0))
    comm, error = packet.write1ByteTxRx(port, 5, LED, 7)
    check("write out of range is refused with error 4", error == 4, error)
    comm, error = packet.write1ByteTxRx(port, 200, LED, 1)
    check("an absent servo times out", comm != COMM_SUCCESS, packet.getTxRxResult(comm))

    for servo in IDS:
        packet.write1ByteTxRx(port, servo, TORQUE_ENABLE, 1)
    goals = GroupSyncWrite(port, packet, GOAL_POSITION, 4)
    for servo in IDS:
        goals.addParam(servo, four(2048 + 20 * servo))
    check("sync write", goals.txPacket() == COMM_SUCCESS)
    deadline = time.monotonic() + 2.0
    arrived = False
    while not arrived and time.monotonic() < deadline:
        positions, comm = sync_read(port, packet, fast=False)
        arrived = comm == COMM_SUCCESS and all(
            abs(positions[servo] - 2048 - 20 * servo) < 5 for servo in IDS
        )
    check("sync read sees all goals reached", arrived, positions)

    if hasattr(GroupSyncRead, "fastSyncRead"):
        positions, comm = sync_read(port, packet, fast=True)
        near = comm == COMM_SUCCESS and all(
            abs(positions[servo] - 2048 - 20 * servo) < 5 for servo in IDS
        )
        check("fast sync read", near, positions)
    else:
        print("skip fast sync read: this SDK has none")

    bulk = GroupBulkRead(port, packet)
    bulk.addParam(2, PRESENT_POSITION, 4)
    bulk.addParam(11, LED, 1)
    comm = bulk.txRxPacket()
    position = bulk.getData(2, PRESENT_POSITION, 4)
    led = bulk.getData(11, LED, 1)
    near = abs(position - 2088) < 5 and led == 0
    check("bulk read", comm == COMM_SUCCESS and near, (position, led))

    comm, error = packet.reboot(port, 7)
    check("reboot", (comm, error) == (COMM_SUCCESS, 0))
    _, comm, _ = packet.ping(port, 7)
    check("silent while it boots", comm != COMM_SUCCESS)
    time.sleep(0.5)
    torque, comm, error = packet.read1ByteTxRx(port, 7, TORQUE_ENABLE)
    check("back within 0.5 s, torque off", (torque, comm) == (0, COMM_SUCCESS), torque)

    cycles, start = 200, time.monotonic()
    bad = sum(sync_read(port, packet, fast=False)[1] != COMM_SUCCESS for _ in range(cycles))
    each_ms = (time.monotonic() - start) / cycles * 1e3
    check(f"{cycles} sync reads of 12 without error, {each_ms:.2f} ms each", bad == 0, bad)
    port.closePort()
    return 1 if failures else 0


def sync_read(port, packet, fast):
    group = GroupSyncRead(port, packet, PRESENT_LOAD, 10)
    for servo in IDS:
        group.addParam(servo)
    comm = group.fastSyncRead() if fast else group.txRxPacket()
    positions = {}
    for servo in IDS:
        if group.isAvailable(servo, PRESENT_POSITION, 4):
            positions[servo] = group.getData(servo, PRESENT_POSITION, 4)
    if len(positions) < len(IDS):
        comm = comm or -1
    return positions, comm


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
