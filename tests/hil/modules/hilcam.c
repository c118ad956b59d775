// SPDX-License-Identifier: GPL-2.0 OR MIT
/*
 * hilcam: a camera whose pictures and faults come from user space.
 *
 * The capture side stands on videobuf2, as uvcvideo does, so that buffers, errors and hot unplugging behave as with a real
 * camera. The other side is the character device /dev/hilcam. A write() to it is either
 *
 *   a picture: struct hilcam_picture, then the bytes; it goes into the oldest queued buffer, or is dropped where there is none;
 *   a command: a line of text, which begins with a letter:
 *     plug N            the camera appears as /dev/videoN
 *     unplug            it disappears, whoever has it open
 *     modes F:WxH@R ... what it offers; F is a four-character code. Refused while it streams
 *     fail streamon E   starting to stream fails with errno E (0: no more)
 *     fail control E    setting a format or asking for buffers fails with errno E
 *     fail queue        the queue of buffers fails now, until streaming is started again
 *     bandwidth B       modes of more than B bytes a second fail to start with ENOSPC (0: no limit)
 *
 * A read() gives one line: whether it is plugged, whether it streams, the mode, pictures delivered and dropped, starts.
 */
#include <linux/fs.h>
#include <linux/miscdevice.h>
#include <linux/module.h>
#include <linux/mutex.h>
#include <linux/platform_device.h>
#include <linux/slab.h>
#include <linux/uaccess.h>
#include <linux/vmalloc.h>
#include <media/v4l2-ctrls.h>
#include <media/v4l2-device.h>
#include <media/v4l2-event.h>
#include <media/v4l2-fh.h>
#include <media/v4l2-ioctl.h>
#include <media/videobuf2-v4l2.h>
#include <media/videobuf2-vmalloc.h>

#define HILCAM_MODES 16
#define HILCAM_MAGIC 0x01424c48 /* "HLB", version 1: no text begins so */
#define HILCAM_BYTES_MAX (16u << 20)

/* Before each picture. The same layout as in tests/hil/src/agent/camera.rs. */
struct hilcam_picture {
	__u32 magic;
	__u32 flags; /* 1: the buffer gets its error flag */
	__s64 timestamp_ns; /* on CLOCK_MONOTONIC; 0: now */
	__u32 fourcc; /* of the bytes; pictures of another mode than the running one are dropped, unless 0 */
	__u32 width;
	__u32 height;
	__u32 sequence_gap; /* numbers to leave out before this picture */
};

struct hilcam_mode {
	u32 fourcc, width, height, rate_hz;
};

struct hilcam_buffer {
	struct vb2_v4l2_buffer vb;
	struct list_head list;
};

struct hilcam {
	struct v4l2_device v4l2_dev;
	struct video_device vdev;
	struct v4l2_ctrl_handler ctrls;
	struct vb2_queue queue;
	struct mutex lock; /* of the ioctls */
	spinlock_t slock; /* of what follows */
	struct list_head buffers;
	struct hilcam_mode mode;
	bool streaming;
	u32 sequence;
};

static DEFINE_MUTEX(bench); /* of what follows; taken within a camera's lock, never around it */
static struct hilcam *plugged;
static struct hilcam_mode modes[HILCAM_MODES] = { { V4L2_PIX_FMT_YUYV, 320, 192, 30 } };
static unsigned int mode_count = 1;
static int fail_streamon, fail_control;
static u64 bandwidth;
static u64 delivered, dropped, starts;
static struct platform_device *platform;

static u32 mode_stride(const struct hilcam_mode *m)
{
	return m->fourcc == V4L2_PIX_FMT_YUYV ? m->width * 2 : m->fourcc == V4L2_PIX_FMT_NV12 ? m->width : 0;
}

static u32 mode_bytes(const struct hilcam_mode *m)
{
	return m->fourcc == V4L2_PIX_FMT_NV12 ? m->width * m->height * 3 / 2 : m->width * m->height * 2;
}

/* What a picture takes of the bus: a compressed one a quarter of its buffer. */
static u64 mode_bus_bytes(const struct hilcam_mode *m)
{
	return m->fourcc == V4L2_PIX_FMT_MJPEG ? mode_bytes(m) / 4 : mode_bytes(m);
}

/* ---- videobuf2 ---- */

static int hilcam_queue_setup(struct vb2_queue *q, unsigned int *buffers, unsigned int *planes, unsigned int sizes[],
			      struct device *devs[])
{
	struct hilcam *cam = vb2_get_drv_priv(q);
	u32 bytes = mode_bytes(&cam->mode);

	if (*planes)
		return sizes[0] < bytes ? -EINVAL : 0;
	*planes = 1;
	sizes[0] = bytes;
	return 0;
}

static int hilcam_buf_prepare(struct vb2_buffer *vb)
{
	struct hilcam *cam = vb2_get_drv_priv(vb->vb2_queue);

	return vb2_plane_size(vb, 0) < mode_bytes(&cam->mode) ? -EINVAL : 0;
}

static void hilcam_buf_queue(struct vb2_buffer *vb)
{
	struct hilcam *cam = vb2_get_drv_priv(vb->vb2_queue);
	struct hilcam_buffer *buf = container_of(to_vb2_v4l2_buffer(vb), struct hilcam_buffer, vb);
	unsigned long irq;

	spin_lock_irqsave(&cam->slock, irq);
	list_add_tail(&buf->list, &cam->buffers);
	spin_unlock_irqrestore(&cam->slock, irq);
}

static struct hilcam_buffer *next_buffer(struct hilcam *cam)
{
	struct hilcam_buffer *buf;
	unsigned long irq;

	spin_lock_irqsave(&cam->slock, irq);
	buf = list_first_entry_or_null(&cam->buffers, struct hilcam_buffer, list);
	if (buf)
		list_del(&buf->list);
	spin_unlock_irqrestore(&cam->slock, irq);
	return buf;
}

static void return_buffers(struct hilcam *cam, enum vb2_buffer_state state)
{
	struct hilcam_buffer *buf;

	while ((buf = next_buffer(cam)))
		vb2_buffer_done(&buf->vb.vb2_buf, state);
}

static int hilcam_start(struct vb2_queue *q, unsigned int count)
{
	struct hilcam *cam = vb2_get_drv_priv(q);
	u64 wanted = mode_bus_bytes(&cam->mode) * cam->mode.rate_hz;
	int error = READ_ONCE(fail_streamon);

	if (!error && READ_ONCE(bandwidth) && wanted > READ_ONCE(bandwidth))
		error = ENOSPC;
	if (error) {
		return_buffers(cam, VB2_BUF_STATE_QUEUED);
		return -error;
	}
	cam->sequence = 0;
	starts++;
	WRITE_ONCE(cam->streaming, true);
	return 0;
}

static void hilcam_stop(struct vb2_queue *q)
{
	struct hilcam *cam = vb2_get_drv_priv(q);

	/* No picture may be on its way into a buffer. */
	mutex_lock(&bench);
	WRITE_ONCE(cam->streaming, false);
	return_buffers(cam, VB2_BUF_STATE_ERROR);
	mutex_unlock(&bench);
}

static const struct vb2_ops hilcam_vb2_ops = {
	.queue_setup = hilcam_queue_setup,
	.buf_prepare = hilcam_buf_prepare,
	.buf_queue = hilcam_buf_queue,
	.start_streaming = hilcam_start,
	.stop_streaming = hilcam_stop,
	.wait_prepare = vb2_ops_wait_prepare,
	.wait_finish = vb2_ops_wait_finish,
};

/* ---- ioctls ---- */

static int hilcam_querycap(struct file *file, void *fh, struct v4l2_capability *cap)
{
	strscpy(cap->driver, "hilcam", sizeof(cap->driver));
	strscpy(cap->card, "HIL camera", sizeof(cap->card));
	strscpy(cap->bus_info, "platform:hilcam", sizeof(cap->bus_info));
	return 0;
}

static int hilcam_enum_fmt(struct file *file, void *fh, struct v4l2_fmtdesc *f)
{
	u32 seen[HILCAM_MODES], count = 0, i, j;

	for (i = 0; i < mode_count; i++) {
		for (j = 0; j < count && seen[j] != modes[i].fourcc; j++)
			;
		if (j == count)
			seen[count++] = modes[i].fourcc;
	}
	if (f->index >= count)
		return -EINVAL;
	f->pixelformat = seen[f->index];
	return 0;
}

static int hilcam_enum_sizes(struct file *file, void *fh, struct v4l2_frmsizeenum *f)
{
	u32 i, n = 0;

	for (i = 0; i < mode_count; i++) {
		if (modes[i].fourcc != f->pixel_format || n++ != f->index)
			continue;
		f->type = V4L2_FRMSIZE_TYPE_DISCRETE;
		f->discrete.width = modes[i].width;
		f->discrete.height = modes[i].height;
		return 0;
	}
	return -EINVAL;
}

static int hilcam_enum_intervals(struct file *file, void *fh, struct v4l2_frmivalenum *f)
{
	u32 i, n = 0;

	for (i = 0; i < mode_count; i++) {
		if (modes[i].fourcc != f->pixel_format || modes[i].width != f->width || modes[i].height != f->height ||
		    n++ != f->index)
			continue;
		f->type = V4L2_FRMIVAL_TYPE_DISCRETE;
		f->discrete.numerator = 1;
		f->discrete.denominator = modes[i].rate_hz;
		return 0;
	}
	return -EINVAL;
}

static void fill_format(struct v4l2_pix_format *pix, const struct hilcam_mode *m)
{
	memset(pix, 0, sizeof(*pix));
	pix->width = m->width;
	pix->height = m->height;
	pix->pixelformat = m->fourcc;
	pix->field = V4L2_FIELD_NONE;
	pix->bytesperline = mode_stride(m);
	pix->sizeimage = mode_bytes(m);
	pix->colorspace = m->fourcc == V4L2_PIX_FMT_MJPEG ? V4L2_COLORSPACE_JPEG : V4L2_COLORSPACE_SMPTE170M;
}

/* The mode of that code whose area is nearest; the first one where the code is unknown. */
static const struct hilcam_mode *nearest(const struct v4l2_pix_format *pix)
{
	const struct hilcam_mode *best = NULL;
	s64 wanted = (s64)pix->width * pix->height, distance = S64_MAX;
	u32 i;

	for (i = 0; i < mode_count; i++) {
		s64 off = abs((s64)modes[i].width * modes[i].height - wanted);

		if (modes[i].fourcc == pix->pixelformat && off < distance) {
			distance = off;
			best = &modes[i];
		}
	}
	return best ? best : &modes[0];
}

static int hilcam_g_fmt(struct file *file, void *fh, struct v4l2_format *f)
{
	struct hilcam *cam = video_drvdata(file);

	fill_format(&f->fmt.pix, &cam->mode);
	return 0;
}

static int hilcam_try_fmt(struct file *file, void *fh, struct v4l2_format *f)
{
	fill_format(&f->fmt.pix, nearest(&f->fmt.pix));
	return 0;
}

static int hilcam_s_fmt(struct file *file, void *fh, struct v4l2_format *f)
{
	struct hilcam *cam = video_drvdata(file);

	if (READ_ONCE(fail_control))
		return -READ_ONCE(fail_control);
	if (vb2_is_busy(&cam->queue))
		return -EBUSY;
	cam->mode = *nearest(&f->fmt.pix);
	fill_format(&f->fmt.pix, &cam->mode);
	return 0;
}

static int hilcam_parm(struct file *file, void *fh, struct v4l2_streamparm *p)
{
	struct hilcam *cam = video_drvdata(file);

	if (p->type != V4L2_BUF_TYPE_VIDEO_CAPTURE)
		return -EINVAL;
	memset(&p->parm, 0, sizeof(p->parm));
	p->parm.capture.capability = V4L2_CAP_TIMEPERFRAME;
	p->parm.capture.timeperframe.numerator = 1;
	p->parm.capture.timeperframe.denominator = cam->mode.rate_hz;
	p->parm.capture.readbuffers = 2;
	return 0;
}

static int hilcam_reqbufs(struct file *file, void *fh, struct v4l2_requestbuffers *r)
{
	if (r->count && READ_ONCE(fail_control))
		return -READ_ONCE(fail_control);
	return vb2_ioctl_reqbufs(file, fh, r);
}

static int hilcam_enum_input(struct file *file, void *fh, struct v4l2_input *input)
{
	if (input->index)
		return -EINVAL;
	input->type = V4L2_INPUT_TYPE_CAMERA;
	strscpy(input->name, "Camera 1", sizeof(input->name));
	return 0;
}

static int hilcam_g_input(struct file *file, void *fh, unsigned int *input)
{
	*input = 0;
	return 0;
}

static int hilcam_s_input(struct file *file, void *fh, unsigned int input)
{
	return input ? -EINVAL : 0;
}

static const struct v4l2_ioctl_ops hilcam_ioctls = {
	.vidioc_querycap = hilcam_querycap,
	.vidioc_enum_fmt_vid_cap = hilcam_enum_fmt,
	.vidioc_enum_framesizes = hilcam_enum_sizes,
	.vidioc_enum_frameintervals = hilcam_enum_intervals,
	.vidioc_g_fmt_vid_cap = hilcam_g_fmt,
	.vidioc_try_fmt_vid_cap = hilcam_try_fmt,
	.vidioc_s_fmt_vid_cap = hilcam_s_fmt,
	.vidioc_g_parm = hilcam_parm,
	.vidioc_s_parm = hilcam_parm,
	.vidioc_reqbufs = hilcam_reqbufs,
	.vidioc_querybuf = vb2_ioctl_querybuf,
	.vidioc_qbuf = vb2_ioctl_qbuf,
	.vidioc_dqbuf = vb2_ioctl_dqbuf,
	.vidioc_expbuf = vb2_ioctl_expbuf,
	.vidioc_create_bufs = vb2_ioctl_create_bufs,
	.vidioc_prepare_buf = vb2_ioctl_prepare_buf,
	.vidioc_streamon = vb2_ioctl_streamon,
	.vidioc_streamoff = vb2_ioctl_streamoff,
	.vidioc_enum_input = hilcam_enum_input,
	.vidioc_g_input = hilcam_g_input,
	.vidioc_s_input = hilcam_s_input,
	.vidioc_subscribe_event = v4l2_ctrl_subscribe_event,
	.vidioc_unsubscribe_event = v4l2_event_unsubscribe,
};

static const struct v4l2_file_operations hilcam_fops = {
	.owner = THIS_MODULE,
	.open = v4l2_fh_open,
	.release = vb2_fop_release,
	.read = vb2_fop_read,
	.poll = vb2_fop_poll,
	.mmap = vb2_fop_mmap,
	.unlocked_ioctl = video_ioctl2,
};

/* ---- coming and going ---- */

/* The last user of an unplugged camera has closed it. */
static void hilcam_release(struct v4l2_device *v4l2_dev)
{
	struct hilcam *cam = container_of(v4l2_dev, struct hilcam, v4l2_dev);

	v4l2_ctrl_handler_free(&cam->ctrls);
	v4l2_device_unregister(&cam->v4l2_dev);
	kfree(cam);
}

static int add_controls(struct hilcam *cam)
{
	struct v4l2_ctrl_handler *h = &cam->ctrls;

	v4l2_ctrl_handler_init(h, 5);
	v4l2_ctrl_new_std(h, NULL, V4L2_CID_AUTO_WHITE_BALANCE, 0, 1, 1, 1);
	v4l2_ctrl_new_std(h, NULL, V4L2_CID_WHITE_BALANCE_TEMPERATURE, 2800, 6500, 1, 4600);
	v4l2_ctrl_new_std_menu(h, NULL, V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_APERTURE_PRIORITY, 0,
			       V4L2_EXPOSURE_APERTURE_PRIORITY);
	v4l2_ctrl_new_std(h, NULL, V4L2_CID_EXPOSURE_ABSOLUTE, 1, 5000, 1, 156);
	v4l2_ctrl_new_std(h, NULL, V4L2_CID_GAIN, 0, 100, 1, 0);
	return h->error;
}

static int plug(int number)
{
	struct hilcam *cam;
	int error;

	if (plugged)
		return -EBUSY;
	cam = kzalloc(sizeof(*cam), GFP_KERNEL);
	if (!cam)
		return -ENOMEM;
	mutex_init(&cam->lock);
	spin_lock_init(&cam->slock);
	INIT_LIST_HEAD(&cam->buffers);
	cam->mode = modes[0];
	cam->v4l2_dev.release = hilcam_release;
	strscpy(cam->v4l2_dev.name, "hilcam", sizeof(cam->v4l2_dev.name));
	error = v4l2_device_register(&platform->dev, &cam->v4l2_dev);
	if (error) {
		kfree(cam);
		return error;
	}
	error = add_controls(cam);
	if (error)
		goto put;
	cam->v4l2_dev.ctrl_handler = &cam->ctrls;
	cam->queue.type = V4L2_BUF_TYPE_VIDEO_CAPTURE;
	cam->queue.io_modes = VB2_MMAP | VB2_READ | VB2_USERPTR;
	cam->queue.drv_priv = cam;
	cam->queue.buf_struct_size = sizeof(struct hilcam_buffer);
	cam->queue.ops = &hilcam_vb2_ops;
	cam->queue.mem_ops = &vb2_vmalloc_memops;
	cam->queue.timestamp_flags = V4L2_BUF_FLAG_TIMESTAMP_MONOTONIC | V4L2_BUF_FLAG_TSTAMP_SRC_SOE;
	cam->queue.min_buffers_needed = 1;
	cam->queue.lock = &cam->lock;
	error = vb2_queue_init(&cam->queue);
	if (error)
		goto put;
	strscpy(cam->vdev.name, "HIL camera", sizeof(cam->vdev.name));
	cam->vdev.fops = &hilcam_fops;
	cam->vdev.ioctl_ops = &hilcam_ioctls;
	cam->vdev.v4l2_dev = &cam->v4l2_dev;
	cam->vdev.queue = &cam->queue;
	cam->vdev.lock = &cam->lock;
	cam->vdev.release = video_device_release_empty;
	cam->vdev.device_caps = V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_STREAMING | V4L2_CAP_READWRITE;
	video_set_drvdata(&cam->vdev, cam);
	error = video_register_device(&cam->vdev, VFL_TYPE_VIDEO, number);
	if (error)
		goto put;
	plugged = cam;
	return 0;
put:
	v4l2_device_put(&cam->v4l2_dev);
	return error;
}

static int unplug(void)
{
	struct hilcam *cam = plugged;

	if (!cam)
		return -ENODEV;
	plugged = NULL;
	/* As uvcvideo: whoever waits is woken, every ioctl now says ENODEV; the memory goes with the last user. */
	vb2_queue_error(&cam->queue);
	v4l2_device_disconnect(&cam->v4l2_dev);
	video_unregister_device(&cam->vdev);
	v4l2_device_put(&cam->v4l2_dev);
	return 0;
}

/* ---- the bench's side ---- */

static int parse_modes(char *text)
{
	struct hilcam_mode parsed[HILCAM_MODES];
	unsigned int count = 0;
	char *word;

	while ((word = strsep(&text, " ")) != NULL) {
		struct hilcam_mode *m = &parsed[count];
		char code[5];

		if (!*word)
			continue;
		if (count == HILCAM_MODES || sscanf(word, "%4c:%ux%u@%u", code, &m->width, &m->height, &m->rate_hz) != 4)
			return -EINVAL;
		if (!m->width || m->width > 4096 || !m->height || m->height > 2048 || !m->rate_hz || m->rate_hz > 1000)
			return -ERANGE;
		m->fourcc = v4l2_fourcc(code[0], code[1], code[2], code[3]);
		count++;
	}
	if (!count)
		return -EINVAL;
	if (plugged && vb2_is_busy(&plugged->queue))
		return -EBUSY;
	memcpy(modes, parsed, count * sizeof(*parsed));
	mode_count = count;
	if (plugged)
		plugged->mode = modes[0];
	return 0;
}

static int command(char *line)
{
	unsigned long long limit;
	int number;

	if (!strcmp(line, "unplug"))
		return unplug();
	if (sscanf(line, "plug %d", &number) == 1)
		return plug(number);
	if (!strncmp(line, "modes ", 6))
		return parse_modes(line + 6);
	if (sscanf(line, "fail streamon %d", &number) == 1 && number >= 0 && number < 4096) {
		WRITE_ONCE(fail_streamon, number);
		return 0;
	}
	if (sscanf(line, "fail control %d", &number) == 1 && number >= 0 && number < 4096) {
		WRITE_ONCE(fail_control, number);
		return 0;
	}
	if (!strcmp(line, "fail queue")) {
		if (!plugged)
			return -ENODEV;
		vb2_queue_error(&plugged->queue);
		return 0;
	}
	if (sscanf(line, "bandwidth %llu", &limit) == 1) {
		WRITE_ONCE(bandwidth, limit);
		return 0;
	}
	return -EINVAL;
}

static int deliver(const struct hilcam_picture *head, const char __user *bytes, size_t count)
{
	struct hilcam *cam = plugged;
	struct hilcam_buffer *buf;
	void *to;

	if (!cam)
		return -ENODEV;
	if (!READ_ONCE(cam->streaming))
		return 0;
	if (head->fourcc && (head->fourcc != cam->mode.fourcc || head->width != cam->mode.width ||
			     head->height != cam->mode.height)) {
		dropped++;
		return 0;
	}
	cam->sequence += head->sequence_gap;
	buf = next_buffer(cam);
	if (!buf) {
		/* A camera goes on counting where nobody gave it a buffer. */
		cam->sequence++;
		dropped++;
		return 0;
	}
	count = min_t(size_t, count, vb2_plane_size(&buf->vb.vb2_buf, 0));
	to = vb2_plane_vaddr(&buf->vb.vb2_buf, 0);
	if (!to || copy_from_user(to, bytes, count)) {
		vb2_buffer_done(&buf->vb.vb2_buf, VB2_BUF_STATE_ERROR);
		return -EFAULT;
	}
	vb2_set_plane_payload(&buf->vb.vb2_buf, 0, count);
	buf->vb.vb2_buf.timestamp = head->timestamp_ns ? head->timestamp_ns : ktime_get_ns();
	buf->vb.sequence = cam->sequence++;
	buf->vb.field = V4L2_FIELD_NONE;
	vb2_buffer_done(&buf->vb.vb2_buf, head->flags & 1 ? VB2_BUF_STATE_ERROR : VB2_BUF_STATE_DONE);
	delivered++;
	return 0;
}

static ssize_t hilcam_bench_write(struct file *file, const char __user *from, size_t count, loff_t *at)
{
	struct hilcam_picture head;
	char line[256];
	int error;

	if (!count || count > HILCAM_BYTES_MAX)
		return -EINVAL;
	mutex_lock(&bench);
	if (count >= sizeof(head) && !copy_from_user(&head, from, sizeof(head)) && head.magic == HILCAM_MAGIC) {
		error = deliver(&head, from + sizeof(head), count - sizeof(head));
	} else if (count >= sizeof(line)) {
		error = -EINVAL;
	} else if (copy_from_user(line, from, count)) {
		error = -EFAULT;
	} else {
		line[count] = 0;
		error = command(strim(line));
	}
	mutex_unlock(&bench);
	return error ? error : count;
}

static ssize_t hilcam_bench_read(struct file *file, char __user *to, size_t count, loff_t *at)
{
	char line[160];
	struct hilcam_mode m;
	bool streaming;

	mutex_lock(&bench);
	m = plugged ? plugged->mode : modes[0];
	streaming = plugged && READ_ONCE(plugged->streaming);
	scnprintf(line, sizeof(line),
		  "{\"plugged\":%d,\"streaming\":%d,\"fourcc\":\"%.4s\",\"width\":%u,\"height\":%u,\"rate_hz\":%u,"
		  "\"delivered\":%llu,\"dropped\":%llu,\"starts\":%llu}\n",
		  plugged ? 1 : 0, streaming, (char *)&m.fourcc, m.width, m.height, m.rate_hz, delivered, dropped, starts);
	mutex_unlock(&bench);
	return simple_read_from_buffer(to, count, at, line, strlen(line));
}

static const struct file_operations hilcam_bench_fops = {
	.owner = THIS_MODULE,
	.write = hilcam_bench_write,
	.read = hilcam_bench_read,
	.llseek = default_llseek,
};

static struct miscdevice hilcam_bench = {
	.minor = MISC_DYNAMIC_MINOR,
	.name = "hilcam",
	.fops = &hilcam_bench_fops,
	.mode = 0600,
};

static int __init hilcam_init(void)
{
	int error;

	platform = platform_device_register_simple("hilcam", PLATFORM_DEVID_NONE, NULL, 0);
	if (IS_ERR(platform))
		return PTR_ERR(platform);
	error = misc_register(&hilcam_bench);
	if (error)
		platform_device_unregister(platform);
	return error;
}

static void __exit hilcam_exit(void)
{
	misc_deregister(&hilcam_bench);
	mutex_lock(&bench);
	unplug();
	mutex_unlock(&bench);
	platform_device_unregister(platform);
}

module_init(hilcam_init);
module_exit(hilcam_exit);
MODULE_DESCRIPTION("Camera whose pictures and faults come from user space");
MODULE_LICENSE("Dual MIT/GPL");
