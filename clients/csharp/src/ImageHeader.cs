using System;
using System.Collections.Generic;

namespace Nep
{
    /// <summary>Size and kind of a JPEG or PNG file, from its first bytes. The EXIF orientation is not considered.</summary>
    internal static class ImageHeader
    {
        /// <summary>The extension of an image message: <c>shape</c> and <c>encoding</c>.</summary>
        /// <exception cref="PayloadException">It is neither JPEG nor PNG.</exception>
        public static Dictionary<object, object> Describe(byte[] file)
        {
            var shape = new List<object>();
            bool isPng = file.Length > 25 && file[0] == 0x89 && file[1] == 'P' && file[2] == 'N' && file[3] == 'G';
            if (isPng)
            {
                shape.Add(BigEndian(file, 20, 4));
                shape.Add(BigEndian(file, 16, 4));
                int kind = file[25];
                shape.Add(kind == 0 ? 1L : kind == 4 ? 2L : kind == 6 ? 4L : 3L);
            }
            else if (!DescribeJpeg(file, shape))
            {
                throw new PayloadException("An image is a JPEG or PNG file.");
            }
            return new Dictionary<object, object> { { "shape", shape }, { "encoding", isPng ? "png" : "jpeg" } };
        }

        private static bool DescribeJpeg(byte[] file, List<object> shape)
        {
            int at = 2;
            while (file.Length > 3 && file[0] == 0xFF && file[1] == 0xD8 && at + 9 < file.Length && file[at] == 0xFF)
            {
                int marker = file[at + 1];
                bool isFrame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
                if (isFrame)
                {
                    shape.Add(BigEndian(file, at + 5, 2));
                    shape.Add(BigEndian(file, at + 7, 2));
                    shape.Add((long)file[at + 9]);
                    return true;
                }
                at += marker == 0xFF ? 1 : 2 + (int)BigEndian(file, at + 2, 2);
            }
            return false;
        }

        private static long BigEndian(byte[] file, int at, int bytes)
        {
            long value = 0;
            for (int i = 0; i < bytes; i++)
            {
                value = value << 8 | file[at + i];
            }
            return value;
        }
    }
}
