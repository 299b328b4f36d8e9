/* Sends and receives positions: over a serial line (standard output and input) or a multicast group.
 *
 * A position is a line of text: the frame's numbers in their order, robot first (layout.h), then [dx dy]... */
#define _DEFAULT_SOURCE
#include "position.h"

#include <arpa/inet.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

static const char USAGE[] =
    "usage: radio send    [-k KEYFILE] [-g GROUP:PORT -n NAME [-i ADDRESS]]   lines to packets, or to datagrams\n"
    "       radio receive [-k KEYFILE] [-g GROUP:PORT [-i ADDRESS]]           the other way round\n"
    "       radio frames  [-k KEYFILE]                                        lines to frames in hex\n"
    "       radio read    [-k KEYFILE]                                        frames in hex to lines\n"
    "NAME is the sender's key, such as fogwatch/yards-1/position/r1; ADDRESS that of the network interface.\n"
    "  stty -F /dev/ttyUSB0 57600 raw -echo; radio receive < /dev/ttyUSB0\n";

enum { LINE = 512, DATAGRAM = 2048, MAX_NAME = 256 };

static uint8_t key_data[FW_MAX_KEY];
static fw_key key = {key_data, 0};
static struct sockaddr_in group;
static struct in_addr interface; /* any, unless told */

static int fail(const char *what) {
    fprintf(stderr, "radio: %s\n", what);
    return 2;
}

/* The next number of a line, if it lies between two others. */
static int next(char **text, int64_t low, int64_t high, int64_t *value) {
    char *end;
    *value = strtoll(*text, &end, 10);
    int found = end != *text && *value >= low && *value <= high;
    *text = end;
    return found;
}

#define PARSE(type, name, least, most) \
    if (!next(&text, least, most, &x)) return 0; \
    p->name = (type)x;

static int parse(char *text, fw_position *p) {
    int64_t x, y;
    FW_EACH_FIELD(PARSE)
    for (p->steps = 0; p->steps < FW_MAX_TRAIL && next(&text, FW_MIN_STEP, FW_MAX_STEP, &x); p->steps++) {
        if (!next(&text, FW_MIN_STEP, FW_MAX_STEP, &y)) return 0;
        p->trail[p->steps][0] = (fw_step)x;
        p->trail[p->steps][1] = (fw_step)y;
    }
    return text[strspn(text, " \n")] == 0;
}

#define SAY(type, name, least, most) printf("%s%lld", before, (long long)p.name), before = " ";

static void say(const uint8_t *frame, size_t bytes) {
    fw_position p;
    if (!fw_decode(frame, bytes, key, &p)) {
        puts("refused");
    } else {
        const char *before = "";
        FW_EACH_FIELD(SAY)
        for (int i = 0; i < p.steps; i++) printf(" %d %d", p.trail[i][0], p.trail[i][1]);
        putchar('\n');
    }
    fflush(stdout);
}

/* Lines to frames: in hex, as packets, or as datagrams of a socket. */
static int lines_out(int hex, int out, const char *name) {
    char text[LINE];
    while (fgets(text, sizeof text, stdin)) {
        uint8_t frame[FW_MAX_FRAME], data[MAX_NAME + 1 + FW_MAX_PACKET];
        fw_position p;
        size_t bytes = parse(text, &p) ? fw_encode(&p, key, frame) : 0, head = strlen(name) + 1;
        if (!bytes) {
            fprintf(stderr, "radio: no position: %s", text);
        } else if (hex) {
            for (size_t i = 0; i < bytes; i++) printf("%02x", frame[i]);
            putchar('\n');
        } else if (out < 0) {
            fwrite(data, 1, fw_pack(frame, bytes, data), stdout);
        } else {
            memcpy(data, name, head);
            memcpy(data + head, frame, bytes);
            if (sendto(out, data, head + bytes, 0, (struct sockaddr *)&group, sizeof group) < 0) perror("radio");
        }
        fflush(stdout);
    }
    return 0;
}

static int hex_in(void) {
    char text[LINE];
    while (fgets(text, sizeof text, stdin)) {
        uint8_t frame[LINE];
        size_t bytes = 0, digits = strspn(text, "0123456789abcdefABCDEF");
        for (unsigned byte; 2 * bytes + 1 < digits && sscanf(text + 2 * bytes, "%2x", &byte) == 1;)
            frame[bytes++] = (uint8_t)byte;
        say(frame, bytes);
    }
    return 0;
}

static int packets_in(void) {
    fw_unpacker line = {.bytes = 0};
    uint8_t frame[FW_MAX_FRAME];
    for (int byte; (byte = getchar()) != EOF;) {
        size_t bytes = fw_unpack(&line, (uint8_t)byte, frame);
        if (bytes) say(frame, bytes);
    }
    return 0;
}

static int datagrams_in(int in) {
    struct ip_mreq member = {.imr_multiaddr = group.sin_addr, .imr_interface = interface};
    int yes = 1;
    if (setsockopt(in, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes) || bind(in, (struct sockaddr *)&group, sizeof group) ||
        setsockopt(in, IPPROTO_IP, IP_ADD_MEMBERSHIP, &member, sizeof member))
        return fail("cannot join the group");
    for (;;) {
        uint8_t data[DATAGRAM];
        ssize_t bytes = recv(in, data, sizeof data, 0);
        const uint8_t *end = bytes > 0 ? memchr(data, 0, (size_t)bytes) : NULL;
        if (end) say(end + 1, (size_t)(data + bytes - end - 1));
    }
}

static int read_key(const char *file) {
    FILE *from = fopen(file, "rb");
    char text[LINE];
    size_t bytes = from ? fread(text, 1, sizeof text, from) : 0, first = 0;
    if (from) fclose(from);
    while (bytes > 0 && strchr(" \t\r\n", text[bytes - 1])) bytes--;
    while (first < bytes && strchr(" \t\r\n", text[first])) first++;
    key.bytes = bytes - first;
    if (key.bytes < 16 || key.bytes > FW_MAX_KEY) return 0;
    memcpy(key_data, text + first, key.bytes);
    return 1;
}

static int read_group(char *address) {
    char *colon = strchr(address, ':');
    if (!colon) return 0;
    *colon = 0;
    group.sin_family = AF_INET;
    group.sin_port = htons((uint16_t)atoi(colon + 1));
    return inet_pton(AF_INET, address, &group.sin_addr) == 1 && group.sin_port != 0;
}

int main(int count, char **words) {
    const char *name = "";
    int by_group = 0;
    if (count < 2) return fputs(USAGE, stderr), 2;
    for (int option; optind = optind < 2 ? 2 : optind, (option = getopt(count, words, "k:g:n:i:")) != -1;) {
        if (option == 'k' && !read_key(optarg)) return fail("-k: not a file with a key of 16 to 64 bytes");
        if (option == 'g' && !(by_group = read_group(optarg))) return fail("-g: write GROUP:PORT, 224.0.0.225:7448");
        if (option == 'i' && inet_pton(AF_INET, optarg, &interface) != 1) return fail("-i: not an address");
        if (option == 'n') name = optarg;
        if (option == '?') return fputs(USAGE, stderr), 2;
    }
    if (strlen(name) >= MAX_NAME) return fail("-n: too long");
    int air = by_group ? socket(AF_INET, SOCK_DGRAM, 0) : -1;
    if (by_group && setsockopt(air, IPPROTO_IP, IP_MULTICAST_IF, &interface, sizeof interface))
        return fail("cannot use that interface");
    if (!strcmp(words[1], "send")) return lines_out(0, air, name);
    if (!strcmp(words[1], "frames")) return lines_out(1, -1, name);
    if (!strcmp(words[1], "read")) return hex_in();
    if (!strcmp(words[1], "receive")) return by_group ? datagrams_in(air) : packets_in();
    return fputs(USAGE, stderr), 2;
}
