/* See position.h. A packet on a serial line: frame and CRC-16, stuffed so that it holds no zero, and a zero. */
#include "position.h"

static uint16_t checksum(const uint8_t *data, size_t bytes) {
    uint16_t crc = 0xffff;
    for (size_t i = 0; i < bytes; i++) {
        crc ^= (uint16_t)(data[i] << 8);
        for (int bit = 0; bit < 8; bit++) crc = (uint16_t)(crc & 0x8000 ? crc << 1 ^ 0x1021 : crc << 1);
    }
    return (uint16_t)~crc;
}

size_t fw_pack(const uint8_t *frame, size_t bytes, uint8_t packet[FW_MAX_PACKET]) {
    if (bytes > FW_MAX_FRAME) return 0;
    const uint16_t crc = checksum(frame, bytes);
    size_t run = 0, at = 1; /* where the length of the present run stands, and where the next byte goes */
    for (size_t i = 0; i < bytes + 2; i++) {
        uint8_t byte = i < bytes ? frame[i] : (uint8_t)(i == bytes ? crc >> 8 : crc);
        if (byte) packet[at++] = byte;
        else packet[run] = (uint8_t)(at - run), run = at++;
    }
    packet[run] = (uint8_t)(at - run);
    packet[at++] = 0;
    return at;
}

size_t fw_unpack(fw_unpacker *line, uint8_t byte, uint8_t frame[FW_MAX_FRAME]) {
    if (byte) {
        if (line->bytes == FW_MAX_PACKET - 1) line->skips = 1;
        else line->data[line->bytes++] = byte;
        return 0;
    }
    uint8_t body[FW_MAX_PACKET];
    size_t bytes = 0, at = 0, length = line->skips ? 0 : line->bytes;
    line->bytes = line->skips = 0;
    while (at < length) {
        size_t until = at + line->data[at];
        if (until > length) return 0;
        while (++at < until) body[bytes++] = line->data[at];
        if (at < length) body[bytes++] = 0;
    }
    if (bytes <= 2 || bytes > FW_MAX_FRAME + 2) return 0;
    bytes -= 2;
    if (checksum(body, bytes) != (uint16_t)(body[bytes] << 8 | body[bytes + 1])) return 0;
    for (size_t i = 0; i < bytes; i++) frame[i] = body[i];
    return bytes;
}
