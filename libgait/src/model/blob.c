#include "model/blob.h"

#include "base/hash.h"

#include <string.h>

#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "blobs are little-endian and used in place"
#endif

enum { HEADER_BYTES = 64, ENTRY_BYTES = 48, CRC_OFFSET = 20 };

typedef struct header {
    char magic[8];
    uint16_t major, minor;
    uint32_t header_bytes, sections, crc;
    uint64_t total;
    unsigned char reserved[32];
} header;

typedef struct entry {
    char tag[4];
    uint32_t dtype, rank, dims[4], reserved;
    uint64_t offset, bytes;
} entry;

_Static_assert(sizeof(header) == HEADER_BYTES && offsetof(header, crc) == CRC_OFFSET, "layout of the file");
_Static_assert(sizeof(entry) == ENTRY_BYTES && offsetof(entry, offset) == 32, "layout of the file");

static entry read_entry(const blob *b, uint32_t i)
{
    entry e;
    memcpy(&e, b->data + HEADER_BYTES + (size_t)i * ENTRY_BYTES, sizeof e);
    return e;
}

static bool all_zero(const unsigned char *p, size_t n)
{
    unsigned char any = 0;
    for (size_t i = 0; i < n; i++)
        any = (unsigned char)(any | p[i]);
    return any == 0;
}

/* CRC of the file with its CRC field set to 0. */
static uint32_t file_crc(const unsigned char *data, size_t bytes)
{
    static const unsigned char zero[4];
    uint32_t crc = hash_crc32(0, data, CRC_OFFSET);
    crc = hash_crc32(crc, zero, sizeof zero);
    return hash_crc32(crc, data + CRC_OFFSET + 4, bytes - CRC_OFFSET - 4);
}

static gait_result check_header(const void *data, size_t bytes, blob *out, gait_error *err)
{
    header h;
    if ((uintptr_t)data % GAIT_ALIGN)
        return base_fail(err, GAIT_ERR_MEMORY, -1, "blob: not aligned to %d bytes", GAIT_ALIGN);
    if (bytes < HEADER_BYTES)
        return base_fail(err, GAIT_ERR_MAGIC, -1, "blob: %zu bytes are too few for a header", bytes);
    memcpy(&h, data, sizeof h);
    if (memcmp(h.magic, "GAITMDL\n", sizeof h.magic) != 0)
        return base_fail(err, GAIT_ERR_MAGIC, -1, "blob: not a libgait model (magic)");
    if (h.major != GAIT_FORMAT_MAJOR)
        return base_fail(err, GAIT_ERR_VERSION, -1, "blob: format %u.%u, this build reads %d.x", h.major,
                         h.minor, GAIT_FORMAT_MAJOR);
    if (h.total != bytes)
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "blob: %zu bytes given, the header has %llu", bytes,
                         (unsigned long long)h.total);
    if (file_crc(data, bytes) != h.crc)
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "blob: checksum does not match");
    if (h.header_bytes != HEADER_BYTES || !all_zero(h.reserved, sizeof h.reserved))
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "blob: header malformed");
    if (h.sections > BLOB_MAX_SECTIONS || (bytes - HEADER_BYTES) / ENTRY_BYTES < h.sections)
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "blob: %u sections do not fit", h.sections);
    *out = (blob){.data = data, .bytes = bytes, .sections = h.sections};
    return GAIT_OK;
}

/* Element size x product of the dimensions; UINT64_MAX if it leaves the 64-bit range of any real file. */
static uint64_t shape_bytes(const entry *e)
{
    uint64_t n = e->dtype == BLOB_U8 ? 1 : 4;
    for (int i = 0; i < 4; i++) {
        if (e->dims[i] && n > (UINT64_MAX >> 1) / e->dims[i])
            return UINT64_MAX;
        n *= e->dims[i];
    }
    return n;
}

static gait_result check_entry(const blob *b, uint32_t i, gait_error *err)
{
    entry const e = read_entry(b, i);
    int const index = (int)i;
    bool shape = e.dtype >= BLOB_U8 && e.dtype <= BLOB_F32 && e.rank >= 1 && e.rank <= 4 && e.reserved == 0;
    for (uint32_t d = e.rank; d < 4; d++)
        shape = shape && e.dims[d] == 1;
    if (!shape || shape_bytes(&e) != e.bytes)
        return base_fail(err, GAIT_ERR_CORRUPT, index, "blob: section %d: malformed type or shape", index);
    if (e.offset % GAIT_ALIGN || e.offset > b->bytes || e.bytes > b->bytes - e.offset)
        return base_fail(err, GAIT_ERR_CORRUPT, index, "blob: section %d: outside the file", index);
    for (uint32_t k = 0; k < i; k++)
        if (memcmp(read_entry(b, k).tag, e.tag, sizeof e.tag) == 0)
            return base_fail(err, GAIT_ERR_CORRUPT, index, "blob: section %d: its tag occurs twice", index);
    return GAIT_OK;
}

/* Index of the non-empty section that lies first at or after pos; b->sections if there is none. */
static uint32_t next_section(const blob *b, uint64_t pos)
{
    uint32_t best = b->sections;
    uint64_t best_offset = UINT64_MAX;
    for (uint32_t i = 0; i < b->sections; i++) {
        entry const e = read_entry(b, i);
        if (e.bytes && e.offset >= pos && e.offset < best_offset) {
            best = i;
            best_offset = e.offset;
        }
    }
    return best;
}

/* Walk through the file in order: every byte belongs to a table or a section or is zero, and no sections
 * overlap. */
static gait_result check_layout(const blob *b, gait_error *err)
{
    uint32_t left = 0, i;
    for (i = 0; i < b->sections; i++)
        left += read_entry(b, i).bytes > 0;
    uint64_t pos = HEADER_BYTES + (uint64_t)b->sections * ENTRY_BYTES;
    while ((i = next_section(b, pos)) < b->sections) {
        entry const e = read_entry(b, i);
        if (!all_zero(b->data + pos, (size_t)(e.offset - pos)))
            return base_fail(err, GAIT_ERR_CORRUPT, (int)i, "blob: gap before section %u is not zero", i);
        pos = e.offset + e.bytes;
        left--;
    }
    if (left)
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "blob: sections overlap");
    if (!all_zero(b->data + pos, (size_t)(b->bytes - pos)))
        return base_fail(err, GAIT_ERR_CORRUPT, -1, "blob: bytes after the last section are not zero");
    return GAIT_OK;
}

gait_result blob_open(const void *data, size_t bytes, blob *out, gait_error *err)
{
    blob b = {0};
    gait_result s = check_header(data, bytes, &b, err);
    for (uint32_t i = 0; s == GAIT_OK && i < b.sections; i++)
        s = check_entry(&b, i, err);
    if (s == GAIT_OK)
        s = check_layout(&b, err);
    if (s == GAIT_OK)
        *out = b;
    return s;
}

bool blob_has(const blob *b, const char tag[4])
{
    for (uint32_t i = 0; i < b->sections; i++)
        if (memcmp(read_entry(b, i).tag, tag, 4) == 0)
            return true;
    return false;
}

const void *blob_section(const blob *b, const char tag[4], uint32_t dtype, uint32_t rank, uint32_t dims[4])
{
    for (uint32_t i = 0; i < b->sections; i++) {
        entry const e = read_entry(b, i);
        if (memcmp(e.tag, tag, sizeof e.tag) == 0 && e.dtype == dtype && e.rank == rank) {
            memcpy(dims, e.dims, sizeof e.dims);
            return b->data + e.offset;
        }
    }
    return NULL;
}
