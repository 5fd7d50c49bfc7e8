"""The names that this driver uses of the maker's library, dynamixel-sdk (extra `hardware`).

Without the library this module can still be imported; `chain` then refuses in one line, because
the control tables are missing, too.
"""

from __future__ import annotations

try:
    from dynamixel_sdk import (
        BROADCAST_ID,
        COMM_RX_CORRUPT,
        COMM_SUCCESS,
        GroupSyncWrite,
        PortHandler,
        Protocol2PacketHandler,
    )
except ModuleNotFoundError:
    BROADCAST_ID = COMM_RX_CORRUPT = COMM_SUCCESS = 0
    GroupSyncWrite = PortHandler = Protocol2PacketHandler = object
