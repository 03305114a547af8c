using System;
using System.Collections.Generic;

namespace Nep
{
    /// <summary>Reader for the size and format of JPEG and PNG files; applies the EXIF orientation.</summary>
    internal static class ImageHeader
    {
        private const int MaxExifBytes = 4096; // other readers don't search further, either
        private const int OrientationTag = 0x0112;
        private const int FirstTransposed = 5;

        /// <summary>Return the extension of an image message: <c>shape</c> and <c>encoding</c>.</summary>
        /// <exception cref="PayloadException">The file is neither JPEG nor PNG.</exception>
        public static Dictionary<object, object> Describe(byte[] file)
        {
            bool isPng = file.Length > 25 && file[0] == 0x89 && file[1] == 'P' && file[2] == 'N' && file[3] == 'G';
            int orientation = 1;
            List<object> shape = isPng ? DescribePng(file, ref orientation) : DescribeJpeg(file, ref orientation);
            if (shape == null)
            {
                throw new PayloadException("The image is neither a JPEG nor a PNG file.");
            }
            if (orientation >= FirstTransposed)
            {
                shape.Reverse(0, 2);
            }
            return new Dictionary<object, object> { { "shape", shape }, { "encoding", isPng ? "png" : "jpeg" } };
        }

        private static List<object> DescribePng(byte[] file, ref int orientation)
        {
            long at = 8;
            while (at + 8 <= file.Length)
            {
                long size = BigEndian(file, (int)at, 4), kind = BigEndian(file, (int)at + 4, 4);
                if (kind == 0x65584966) // eXIf
                {
                    ReadOrientation(file, (int)at + 8, size, ref orientation);
                }
                at += 12 + size;
            }
            int colour = file[25];
            long channels = colour == 0 ? 1 : colour == 4 ? 2 : colour == 6 ? 4 : 3;
            return new List<object> { BigEndian(file, 20, 4), BigEndian(file, 16, 4), channels };
        }

        private static List<object> DescribeJpeg(byte[] file, ref int orientation)
        {
            List<object> shape = null;
            int at = 2;
            while (file.Length > 3 && file[0] == 0xFF && file[1] == 0xD8 && at + 9 < file.Length && file[at] == 0xFF)
            {
                int marker = file[at + 1];
                if (marker == 0xDA) // start of the pixels
                {
                    break;
                }
                bool isFrame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
                int size = marker == 0xFF ? -1 : (int)BigEndian(file, at + 2, 2);
                if (isFrame)
                {
                    shape = new List<object> { BigEndian(file, at + 5, 2), BigEndian(file, at + 7, 2), (long)file[at + 9] };
                }
                else if (marker == 0xE1 && size > 8 && BigEndian(file, at + 4, 4) == 0x45786966) // APP1 with "Exif"
                {
                    ReadOrientation(file, at + 10, size - 8, ref orientation);
                }
                at += 2 + size;
            }
            return shape;
        }

        /// <summary>Read the orientation from TIFF data; unchanged if there is none.</summary>
        private static void ReadOrientation(byte[] file, int at, long size, ref int orientation)
        {
            long end = Math.Min(file.Length, at + Math.Min(size, MaxExifBytes));
            if (at + 8 > end)
            {
                return;
            }
            long order = BigEndian(file, at, 4);
            bool isLittle = order == 0x49492A00;
            if (!isLittle && order != 0x4D4D002A)
            {
                return;
            }
            long directory = at + Number(file, at + 4, 4, isLittle);
            if (directory + 2 > end)
            {
                return;
            }
            long count = Number(file, (int)directory, 2, isLittle);
            for (long entry = directory + 2; count > 0 && entry + 12 <= end; entry += 12, count--)
            {
                if (Number(file, (int)entry, 2, isLittle) == OrientationTag)
                {
                    long told = Number(file, (int)entry + 8, 2, isLittle);
                    orientation = told >= 1 && told <= 8 ? (int)told : orientation;
                    return;
                }
            }
        }

        private static long Number(byte[] file, int at, int bytes, bool isLittle)
        {
            long value = 0;
            for (int i = 0; i < bytes; i++)
            {
                value = value << 8 | file[isLittle ? at + bytes - 1 - i : at + i];
            }
            return value;
        }

        private static long BigEndian(byte[] file, int at, int bytes)
        {
            return Number(file, at, bytes, false);
        }
    }
}
