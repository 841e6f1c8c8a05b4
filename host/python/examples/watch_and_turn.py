"""One task turns an axis, another watches the events and stops all at the first trip.

    python watch_and_turn.py PORT AXIS SECONDS
"""

import asyncio
import sys

from motor_gateway import AsyncArmed, AsyncGateway, make_velocity


async def watch(gateway: AsyncGateway) -> None:
    while (event := await gateway.event()).name != "tripped":
        print(event.name, event.axis)
    print(f"axis {event.axis} tripped: {event.fields['trip']['reason']}")
    await gateway.stop()


async def turn(motors: AsyncArmed, axis: int) -> None:
    while True:
        await motors.cycle([make_velocity(axis, 1.0)])
        await asyncio.sleep(0.01)


async def main(port: str, axis: int, lasts_s: float) -> None:
    async with await AsyncGateway.connect(port) as gateway:
        watching = asyncio.create_task(watch(gateway))
        async with await gateway.arm(axis) as motors:
            turning = asyncio.create_task(turn(motors, axis))
            await asyncio.wait(
                [turning, watching], timeout=lasts_s, return_when=asyncio.FIRST_COMPLETED
            )
            for task in (turning, watching):
                task.cancel()
            await asyncio.gather(turning, watching, return_exceptions=True)
    print("stopped")


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1], int(sys.argv[2]), float(sys.argv[3])))
