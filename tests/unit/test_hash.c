#include "base/hash.h"

#include "check.h"

/* Published answers: FNV's test suite, and the check value of CRC-32/ISO-HDLC. */
int main(void)
{
    CHECK(hash_fnv1a(HASH_INIT, "", 0) == UINT64_C(0xcbf29ce484222325));
    CHECK(hash_fnv1a(HASH_INIT, "a", 1) == UINT64_C(0xaf63dc4c8601ec8c));
    CHECK(hash_fnv1a(HASH_INIT, "foobar", 6) == UINT64_C(0x85944171f73967e8));
    CHECK(hash_crc32(0, "", 0) == 0);
    CHECK(hash_crc32(0, "123456789", 9) == 0xcbf43926u);
    CHECK(hash_crc32(0, "a", 1) == 0xe8b7be43u);
    for (size_t cut = 0; cut <= 9; cut++) {
        const char *const text = "123456789";
        CHECK(hash_crc32(hash_crc32(0, text, cut), text + cut, 9 - cut) == 0xcbf43926u);
        uint64_t const begun = hash_fnv1a(HASH_INIT, text, cut);
        CHECK(hash_fnv1a(begun, text + cut, 9 - cut) == hash_fnv1a(HASH_INIT, text, 9));
    }
    return CHECK_DONE();
}
