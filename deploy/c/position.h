/* The position frame of fogwatch, for microcontrollers: C99, whole numbers only, no memory of its own.
 *
 * A robot says where it is in about 20 bytes: docs/network.md, "What is on the wire". */
#ifndef FOGWATCH_POSITION_H
#define FOGWATCH_POSITION_H

#include <stddef.h>
#include <stdint.h>

#include "layout.h" /* version, sizes, and the numbers of a frame: robot, sequence, time_ms, ... */

enum {
    FW_MAX_HEADING = FW_MAX_HEADING_MRAD,
    FW_MAX_PACKET = FW_MAX_FRAME + 4 /* bytes on a serial line */
};

#define FW_MEMBER(type, name, least, most) type name;
typedef struct {
    FW_EACH_FIELD(FW_MEMBER)
    uint8_t steps;                   /* past positions: 0 to FW_MAX_TRAIL */
    fw_step trail[FW_MAX_TRAIL][2]; /* cm: the first step leads from this position to the one before it, and so on */
} fw_position;
#undef FW_MEMBER

/* The fleet's key, or none where `bytes` is 0. */
typedef struct {
    const uint8_t *data;
    size_t bytes;
} fw_key;

/* Write a frame; its length, or 0 for a position or a key that does not fit. */
size_t fw_encode(const fw_position *position, fw_key key, uint8_t frame[FW_MAX_FRAME]);

/* Read a frame, any bytes at all; 1, or 0 for one that must not be used. With a key it needs the right tag. */
int fw_decode(const uint8_t *frame, size_t bytes, fw_key key, fw_position *position);

/* Write a frame's packet for a serial line; its length, or 0 for a frame that is too long. */
size_t fw_pack(const uint8_t *frame, size_t bytes, uint8_t packet[FW_MAX_PACKET]);

/* What has come of a packet so far; all zero to begin with. */
typedef struct {
    uint8_t data[FW_MAX_PACKET];
    uint8_t bytes;
    uint8_t skips;
} fw_unpacker;

/* Take the next byte from a serial line; the length of the frame that ends with it, or 0. */
size_t fw_unpack(fw_unpacker *line, uint8_t byte, uint8_t frame[FW_MAX_FRAME]);

#endif
