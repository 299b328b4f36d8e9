/* See position.h. A frame is a msgpack array of small integers, perhaps with a trail and a tag (keyed BLAKE2b). */
#include "position.h"

#include <string.h>

enum { FIELDS = FW_FIELDS + 1, TAG = FW_TAG, TAG_ALL = TAG + 2, BLOCK = 128 };

/* --- the tag: BLAKE2b (RFC 7693) of a key and one short message ------------------------------------------------- */

static const uint64_t IV[8] = {
    0x6a09e667f3bcc908u, 0xbb67ae8584caa73bu, 0x3c6ef372fe94f82bu, 0xa54ff53a5f1d36f1u,
    0x510e527fade682d1u, 0x9b05688c2b3e6c1fu, 0x1f83d9abfb41bd6bu, 0x5be0cd19137e2179u};

static const uint8_t SIGMA[10][16] = {
    {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15}, {14, 10, 4, 8, 9, 15, 13, 6, 1, 12, 0, 2, 11, 7, 5, 3},
    {11, 8, 12, 0, 5, 2, 15, 13, 10, 14, 3, 6, 7, 1, 9, 4}, {7, 9, 3, 1, 13, 12, 11, 14, 2, 6, 5, 10, 4, 0, 15, 8},
    {9, 0, 5, 7, 2, 4, 10, 15, 14, 1, 11, 12, 6, 8, 3, 13}, {2, 12, 6, 10, 0, 11, 8, 3, 4, 13, 7, 5, 15, 14, 1, 9},
    {12, 5, 1, 15, 14, 13, 4, 10, 0, 7, 6, 3, 9, 2, 8, 11}, {13, 11, 7, 14, 12, 1, 3, 9, 5, 0, 15, 4, 8, 6, 2, 10},
    {6, 15, 14, 9, 11, 3, 0, 8, 12, 2, 13, 7, 1, 4, 10, 5}, {10, 2, 8, 4, 7, 6, 1, 5, 15, 11, 9, 14, 3, 12, 13, 0}};

static uint64_t rotated(uint64_t word, int by) { return word >> by | word << (64 - by); }

static void mix(uint64_t v[16], int a, int b, int c, int d, uint64_t x, uint64_t y) {
    v[a] += v[b] + x; v[d] = rotated(v[d] ^ v[a], 32); v[c] += v[d]; v[b] = rotated(v[b] ^ v[c], 24);
    v[a] += v[b] + y; v[d] = rotated(v[d] ^ v[a], 16); v[c] += v[d]; v[b] = rotated(v[b] ^ v[c], 63);
}

static void compress(uint64_t h[8], const uint8_t *data, size_t bytes, uint64_t so_far, int last) {
    uint64_t v[16], m[16] = {0};
    for (size_t i = 0; i < bytes; i++) m[i / 8] |= (uint64_t)data[i] << 8 * (i % 8);
    for (int i = 0; i < 8; i++) v[i] = h[i], v[i + 8] = IV[i];
    v[12] ^= so_far;
    if (last) v[14] = ~v[14];
    for (int round = 0; round < 12; round++) {
        const uint8_t *s = SIGMA[round % 10];
        for (int i = 0; i < 4; i++) mix(v, i, i + 4, i + 8, i + 12, m[s[2 * i]], m[s[2 * i + 1]]);
        for (int i = 0; i < 4; i++)
            mix(v, i, (i + 1) % 4 + 4, (i + 2) % 4 + 8, (i + 3) % 4 + 12, m[s[2 * i + 8]], m[s[2 * i + 9]]);
    }
    for (int i = 0; i < 8; i++) h[i] ^= v[i] ^ v[i + 8];
}

static void tag_of(const uint8_t *body, size_t bytes, fw_key key, uint8_t tag[TAG]) {
    uint64_t h[8];
    memcpy(h, IV, sizeof h);
    h[0] ^= 0x01010000u ^ (uint64_t)key.bytes << 8 ^ TAG;
    compress(h, key.data, key.bytes, BLOCK, 0);
    compress(h, body, bytes, BLOCK + bytes, 1);
    for (int i = 0; i < TAG; i++) tag[i] = (uint8_t)(h[0] >> 8 * i);
}

/* --- encoding --------------------------------------------------------------------------------------------------- */

static uint8_t *put(uint8_t *at, uint8_t head, uint32_t bits, int bytes) {
    *at++ = head;
    while (bytes--) *at++ = (uint8_t)(bits >> 8 * bytes);
    return at;
}

/* A number in as few bytes as it needs. */
static uint8_t *put_number(uint8_t *at, int64_t value) {
    uint32_t bits = (uint32_t)value;
    if (value >= -32 && value < 128) return put(at, (uint8_t)bits, 0, 0);
    if (value >= 0) return value < 256 ? put(at, 0xcc, bits, 1) : value < 65536 ? put(at, 0xcd, bits, 2) : put(at, 0xce, bits, 4);
    return value >= -128 ? put(at, 0xd0, bits, 1) : value >= -32768 ? put(at, 0xd1, bits, 2) : put(at, 0xd2, bits, 4);
}

static int fits(int64_t value, int64_t low, int64_t high) { return value >= low && value <= high; }

#define FITS(type, name, least, most) && fits(p->name, least, most)
#define VALUE(type, name, least, most) p->name,

size_t fw_encode(const fw_position *p, fw_key key, uint8_t frame[FW_MAX_FRAME]) {
    if (!(p->steps <= FW_MAX_TRAIL && key.bytes <= FW_MAX_KEY FW_EACH_FIELD(FITS))) return 0;
    const int64_t fields[FIELDS] = {FW_VERSION, FW_EACH_FIELD(VALUE)};
    uint8_t *at = frame;
    *at++ = (uint8_t)(0x90 + FIELDS + (p->steps > 0) + (key.bytes > 0));
    for (int i = 0; i < FIELDS; i++) at = put_number(at, fields[i]);
    if (p->steps > 0) *at++ = (uint8_t)(0x90 + 2 * p->steps);
    for (int i = 0; i < 2 * p->steps; i++) at = put_number(at, p->trail[i / 2][i % 2]);
    if (key.bytes > 0) {
        uint8_t tag[TAG];
        tag_of(frame, (size_t)(at - frame), key, tag);
        *at++ = 0xc4;
        *at++ = TAG;
        memcpy(at, tag, TAG);
        at += TAG;
    }
    return (size_t)(at - frame);
}

/* --- decoding: whoever reads past the end or finds what it does not want sets `ok` to 0, and goes on harmlessly -- */

typedef struct {
    const uint8_t *at, *end;
    int ok;
} reader;

static uint64_t take(reader *r, size_t bytes) {
    uint64_t bits = 0;
    if ((size_t)(r->end - r->at) < bytes) return r->ok = 0;
    while (bytes--) bits = bits << 8 | *r->at++;
    return bits;
}

/* A whole number in any of msgpack's forms, which must lie between two others. */
static int64_t number(reader *r, int64_t low, int64_t high) {
    uint8_t head = (uint8_t)take(r, 1);
    int64_t value = 0;
    if (head < 0x80) value = head;
    else if (head >= 0xe0) value = (int64_t)head - 256;
    else if (head >= 0xcc && head <= 0xd3) {
        size_t bytes = (size_t)1 << (head & 3);
        uint64_t bits = take(r, bytes), sign = (uint64_t)1 << (8 * bytes - 1);
        if (head < 0xd0) {
            if (bits > INT64_MAX) r->ok = 0;
            else value = (int64_t)bits;
        } else value = bits < sign ? (int64_t)bits : -(int64_t)(2 * sign - bits - 1) - 1;
    } else r->ok = 0;
    if (!fits(value, low, high)) r->ok = 0;
    return r->ok ? value : 0;
}

/* How many things follow in an array. */
static size_t array(reader *r) {
    uint8_t head = (uint8_t)take(r, 1);
    if (head >= 0x90 && head < 0xa0) return head - 0x90u;
    if (head == 0xdc) return (size_t)take(r, 2);
    if (head == 0xdd) return (size_t)take(r, 4);
    return (size_t)(r->ok = 0);
}

#define READ(type, name, least, most) p->name = (type)number(&r, least, most);

int fw_decode(const uint8_t *frame, size_t bytes, fw_key key, fw_position *p) {
    reader r = {frame, frame + bytes, bytes <= FW_MAX_FRAME && key.bytes <= FW_MAX_KEY};
    size_t values = r.ok ? array(&r) : 0;
    if (values < FIELDS || values > FIELDS + 2) return 0;
    number(&r, FW_VERSION, FW_VERSION);
    FW_EACH_FIELD(READ)
    p->steps = 0;
    if (!r.ok) return 0;
    int tagged = values > FIELDS && r.at < r.end && *r.at >= 0xc4 && *r.at <= 0xc6;
    if (values > FIELDS && !tagged) {
        size_t numbers = array(&r);
        if (!r.ok || numbers == 0 || numbers > 2 * FW_MAX_TRAIL || numbers % 2) return 0;
        p->steps = (uint8_t)(numbers / 2);
        for (size_t i = 0; i < numbers; i++) p->trail[i / 2][i % 2] = (fw_step)number(&r, FW_MIN_STEP, FW_MAX_STEP);
        tagged = values == FIELDS + 2;
    } else if (values == FIELDS + 2) return 0; /* a tag is the last */
    if (tagged) {
        uint8_t head = (uint8_t)take(&r, 1);
        if (!r.ok || head < 0xc4 || head > 0xc6) return 0;
        size_t length = (size_t)take(&r, (size_t)1 << (head - 0xc4));
        if (!r.ok || length != (size_t)(r.end - r.at)) return 0;
        if (bytes < TAG_ALL || frame[bytes - TAG_ALL] != 0xc4 || frame[bytes - TAG_ALL + 1] != TAG) return 0;
    } else if (r.at != r.end) return 0;
    if (!r.ok || key.bytes == 0) return r.ok;
    uint8_t tag[TAG], differs = 0;
    if (!tagged) return 0;
    tag_of(frame, bytes - TAG_ALL, key, tag);
    for (int i = 0; i < TAG; i++) differs |= tag[i] ^ frame[bytes - TAG + i];
    return differs == 0;
}
