/* Made by deploy/c/layout.py from patrol/radio/message.py: change that, and run `make layout`. */
#ifndef FOGWATCH_LAYOUT_H
#define FOGWATCH_LAYOUT_H

#include <stdint.h>

enum {
    FW_VERSION = 1,
    FW_CONTACT = 0,
    FW_MAX_FRAME = 64,
    FW_MAX_TRAIL = 4,
    FW_MAX_KEY = 64,
    FW_TAG = 8,
    FW_FIELDS = 6,
    FW_MAX_HEADING_MRAD = 6283
};

/* The numbers of a frame after its version, in their order: type, name, least, most.
 *
 * robot: its number from 1, or 0 for an intruder that the sender sees
 * sequence: the fleet's tick
 * time_ms: ms, of the sender's clock; the most after 49.7 days
 * x_cm: cm, of the robot's centre
 * y_cm: cm, of the robot's centre
 * heading_mrad: mrad, counter-clockwise from the x axis, round the circle
 */
#define FW_EACH_FIELD(FIELD) \
    FIELD(uint16_t, robot, 0, UINT16_MAX) \
    FIELD(uint32_t, sequence, 0, UINT32_MAX) \
    FIELD(uint32_t, time_ms, 0, UINT32_MAX) \
    FIELD(int32_t, x_cm, INT32_MIN, INT32_MAX) \
    FIELD(int32_t, y_cm, INT32_MIN, INT32_MAX) \
    FIELD(uint16_t, heading_mrad, 0, 6283)

/* A number of a trail: cm, from a position to the one before it, along x or y. */
typedef int16_t fw_step;
enum {
    FW_MIN_STEP = INT16_MIN,
    FW_MAX_STEP = INT16_MAX
};

#endif
