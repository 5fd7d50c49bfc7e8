"""MAVLink messages, frames, modes and signing; no sockets."""
