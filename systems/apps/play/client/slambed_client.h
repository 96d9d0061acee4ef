/* SPDX-License-Identifier: Apache-2.0 */
/* The client of slambed-play for systems in C or C++ (docs/reference/system.md).
 *
 *   slambed_client client;
 *   if (slambed_open(&client) != 0) return 1;          // prints why
 *   slambed_ready(&client);                            // vocabulary loaded, edge connected
 *   slambed_frame frame;
 *   while (slambed_next(&client, &frame) == 1) {       // 0: playback is over, -1: no player
 *     const uint8_t* gray = slambed_gray(&client, &frame);
 *     ...
 *     slambed_pose pose = slambed_tracked(&frame, T_wc, q_wc);   // or slambed_untracked
 *     slambed_send_pose(&client, &pose);
 *   }
 *   slambed_send_final(&client, &pose);                // optional, per frame: its final pose
 *   slambed_close(&client);
 *
 * Messages are packets on a socket in host byte order; pixels are in shared memory. */
#ifndef SLAMBED_CLIENT_H
#define SLAMBED_CLIENT_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <unistd.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { SLAMBED_PROTOCOL = 1, SLAMBED_EVENT_BYTES = 4096 };
enum slambed_type {
  SLAMBED_HELLO = 1, /* client: first message; answered by slambed_info */
  SLAMBED_INFO = 2,
  SLAMBED_READY = 3, /* client: the run may begin */
  SLAMBED_NEXT = 4,  /* client: requests a frame; answered by slambed_frame or SLAMBED_END */
  SLAMBED_FRAME = 5,
  SLAMBED_END = 6,   /* no more frames; an edge gets it unrequested when the run is over */
  SLAMBED_POSE = 7,  /* client: the pose of a frame from tracking */
  SLAMBED_FINAL = 8, /* client: the pose of a frame in the finished map */
  SLAMBED_EVENT = 9  /* client: a JSON object with "type", after the four bytes of the type */
};
enum slambed_sensor { SLAMBED_RGBD = 0, SLAMBED_STEREO = 1, SLAMBED_MONO = 2 };
enum slambed_state { SLAMBED_OK = 0, SLAMBED_LOST = 1, SLAMBED_NOT_INITIALIZED = 2 };

typedef struct {
  uint32_t type, protocol;
  uint32_t sensor, width, height;
  uint32_t slots; /* number of most recent frames that stay unchanged */
  uint64_t slot_bytes;
  double fx, fy, cx, cy; /* pixels */
  double bf;             /* fx times baseline, px*m */
  double distortion[5];  /* OpenCV's k1, k2, p1, p2, k3; stereo pictures are rectified */
  double depth_unit_m;   /* meters per step of the depth picture */
  double fps;            /* of the playback */
} slambed_info;

typedef struct {
  uint32_t type, slot;
  uint64_t index;      /* in the sequence */
  int64_t recorded_ns; /* timestamp of the recording */
  double seq_s;        /* since the first played frame */
} slambed_frame;

typedef struct {
  uint32_t type, state;
  uint64_t index;
  double t_wc[3];            /* camera in the world frame, meters */
  double q_wc[4];            /* x, y, z, w: camera to world */
  int32_t features, inliers; /* -1: unknown */
} slambed_pose;

typedef struct {
  int socket;
  const uint8_t* pixels; /* NULL on an edge */
  size_t bytes;
  slambed_info info;
} slambed_client;

static inline int slambed_send_type(slambed_client* c, uint32_t type) {
  return send(c->socket, &type, sizeof type, MSG_NOSIGNAL) == (ssize_t)sizeof type ? 0 : -1;
}

/* Returns 0, or -1 with a line on standard error. */
static inline int slambed_open(slambed_client* c) {
  const char* channel = getenv("SLAMBED_CLIENT");
  int memory = -1;
  memset(c, 0, sizeof *c);
  if (channel == NULL || sscanf(channel, "%d,%d", &c->socket, &memory) != 2) {
    fprintf(stderr, "error: SLAMBED_CLIENT is not set; let slambed-play start this program\n");
    return -1;
  }
  if (slambed_send_type(c, SLAMBED_HELLO) != 0 ||
      recv(c->socket, &c->info, sizeof c->info, 0) != (ssize_t)sizeof c->info ||
      c->info.type != SLAMBED_INFO || c->info.protocol != SLAMBED_PROTOCOL) {
    fprintf(stderr, "error: slambed-play speaks another protocol; take its own slambed_client.h\n");
    return -1;
  }
  c->bytes = (size_t)c->info.slots * c->info.slot_bytes;
  if (c->bytes > 0) {
    void* at = mmap(NULL, c->bytes, PROT_READ, MAP_SHARED, memory, 0);
    if (at == MAP_FAILED) {
      perror("error: the player's pictures cannot be mapped");
      return -1;
    }
    c->pixels = (const uint8_t*)at;
  }
  return 0;
}

static inline int slambed_ready(slambed_client* c) { return slambed_send_type(c, SLAMBED_READY); }

/* Waits for a frame. Returns 1, 0 if there are no more, or -1 if the player is gone. */
static inline int slambed_next(slambed_client* c, slambed_frame* frame) {
  if (slambed_send_type(c, SLAMBED_NEXT) != 0) return -1;
  if (recv(c->socket, frame, sizeof *frame, 0) < (ssize_t)sizeof frame->type) return -1;
  return frame->type == SLAMBED_FRAME ? 1 : 0;
}

/* width * height bytes. */
static inline const uint8_t* slambed_gray(const slambed_client* c, const slambed_frame* f) {
  return c->pixels + f->slot * c->info.slot_bytes;
}

/* rgbd: width * height values of uint16_t, 0 without depth; stereo: the right picture. */
static inline const void* slambed_second(const slambed_client* c, const slambed_frame* f) {
  return slambed_gray(c, f) + (size_t)c->info.width * c->info.height;
}

static inline slambed_pose slambed_tracked(const slambed_frame* f, const double t_wc[3],
                                           const double q_wc[4]) {
  slambed_pose pose;
  memset(&pose, 0, sizeof pose);
  pose.index = f->index;
  memcpy(pose.t_wc, t_wc, sizeof pose.t_wc);
  memcpy(pose.q_wc, q_wc, sizeof pose.q_wc);
  pose.features = pose.inliers = -1;
  return pose;
}

static inline slambed_pose slambed_untracked(const slambed_frame* f, enum slambed_state state) {
  const double t[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1};
  slambed_pose pose = slambed_tracked(f, t, q);
  pose.state = (uint32_t)state;
  return pose;
}

static inline int slambed_send_packet(slambed_client* c, slambed_pose pose, uint32_t type) {
  pose.type = type;
  return send(c->socket, &pose, sizeof pose, MSG_NOSIGNAL) == (ssize_t)sizeof pose ? 0 : -1;
}

static inline int slambed_send_pose(slambed_client* c, const slambed_pose* pose) {
  return slambed_send_packet(c, *pose, SLAMBED_POSE);
}

static inline int slambed_send_final(slambed_client* c, const slambed_pose* pose) {
  return slambed_send_packet(c, *pose, SLAMBED_FINAL);
}

/* Sends an event for the system's own metrics, e.g. {"type": "map", "points": 812}. */
static inline int slambed_send_event(slambed_client* c, const char* json) {
  char packet[sizeof(uint32_t) + SLAMBED_EVENT_BYTES];
  const uint32_t type = SLAMBED_EVENT;
  const size_t length = strlen(json);
  if (length > SLAMBED_EVENT_BYTES) return -1;
  memcpy(packet, &type, sizeof type);
  memcpy(packet + sizeof type, json, length);
  const size_t bytes = sizeof type + length;
  return send(c->socket, packet, bytes, MSG_NOSIGNAL) == (ssize_t)bytes ? 0 : -1;
}

/* Returns a parameter of system.yaml as text, or NULL if there is none with this name. */
static inline const char* slambed_param(const char* upper_case_name) {
  char name[128];
  snprintf(name, sizeof name, "SLAMBED_PARAM_%s", upper_case_name);
  return getenv(name);
}

static inline void slambed_close(slambed_client* c) {
  if (c->pixels != NULL) munmap((void*)c->pixels, c->bytes);
  close(c->socket);
}

#ifdef __cplusplus
}
#endif

#endif
