/* instructions_plugin.c - a plugin of QEMU that prints how many instructions a program executed.
 * The declarations are copied from version 1 of its interface (qemu-plugin.h), which Debian does not package. */
#include <stdint.h>
#include <stdio.h>

#define PUBLIC __attribute__((visibility("default")))
enum { ADD = 0 };
struct qemu_plugin_tb;
void qemu_plugin_register_vcpu_tb_trans_cb(uint64_t id, void (*f)(uint64_t id, struct qemu_plugin_tb *block));
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *block, int op, void *to, uint64_t value);
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *block);
void qemu_plugin_register_atexit_cb(uint64_t id, void (*f)(uint64_t id, void *user), void *user);
PUBLIC int qemu_plugin_install(uint64_t id, const void *info, int argc, char **argv);

PUBLIC int qemu_plugin_version = 1;
static uint64_t executed;

static void translate(uint64_t id, struct qemu_plugin_tb *block)
{
    (void)id;
    qemu_plugin_register_vcpu_tb_exec_inline(block, ADD, &executed, qemu_plugin_tb_n_insns(block));
}

static void finish(uint64_t id, void *user)
{
    (void)id;
    (void)user;
    printf("%llu\n", (unsigned long long)executed);
    fflush(stdout); /* QEMU exits without flushing */
}

int qemu_plugin_install(uint64_t id, const void *info, int argc, char **argv)
{
    (void)info;
    (void)argc;
    (void)argv;
    qemu_plugin_register_vcpu_tb_trans_cb(id, translate);
    qemu_plugin_register_atexit_cb(id, finish, NULL);
    return 0;
}
